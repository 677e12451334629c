//! From a folder to a [`Scenario`]. The only file of the loader that touches the disk.

use super::diagnostic::{Invalid, LoadError};
use super::file::{self, Beside};
use super::{Scenario, schedule};
use std::path::Path;

/// The file that makes a folder a scenario.
pub const MAIN_FILE: &str = "scenario.toml";

impl Scenario {
    /// Reads the scenario in `folder`: its `scenario.toml`, and the files that it names.
    ///
    /// # Errors
    /// [`LoadError::Unreadable`] without a readable `scenario.toml`, [`LoadError::Invalid`] with
    /// every problem found in it otherwise.
    pub fn load(folder: &Path) -> Result<Self, LoadError> {
        let path = folder.join(MAIN_FILE);
        let text = std::fs::read_to_string(&path).map_err(|source| LoadError::Unreadable {
            path: path.clone(),
            source,
        })?;
        let read = |name: &str| std::fs::read(folder.join(name));
        let mut scenario = Self::parse(&path.display().to_string(), &text, &read)?;
        scenario.folder = folder.to_path_buf();
        Ok(scenario)
    }

    /// Reads a scenario from the `text` of its main file; `read` gives what is in the files that it
    /// names, `file` is how diagnostics call the main file.
    ///
    /// # Errors
    /// Every problem found, each with its line and column.
    pub fn parse(
        file: &str,
        text: &str,
        read: &dyn Fn(&str) -> std::io::Result<Vec<u8>>,
    ) -> Result<Self, Box<Invalid>> {
        let (mut scenario, schedule) = file::scenario(text, read)
            .map_err(|problems| Box::new(Invalid::new(file, text, problems)))?;
        if let Some(Beside { path, text }) = schedule {
            let path = Path::new(file).with_file_name(path).display().to_string();
            schedule::extend(&mut scenario, &path, &text)?;
        }
        Ok(scenario)
    }
}
