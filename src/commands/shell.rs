//! `cortex completions` and `cortex man`: what a shell and `man` know of the command line, from the same
//! declarations that parse it.

use super::output::{print, tell};
use crate::cli::{Cli, Completions, Man};
use crate::{Answer, Failure};
use clap::CommandFactory;

pub(crate) fn completions(arguments: &Completions) -> Result<Answer, Failure> {
    let mut script = Vec::new();
    let mut command = Cli::command();
    clap_complete::generate(arguments.shell, &mut command, "cortex", &mut script);
    print(&String::from_utf8_lossy(&script))?;
    Ok(Answer::Yes)
}

pub(crate) fn man(arguments: &Man) -> Result<Answer, Failure> {
    let folder = &arguments.folder;
    let failed = |error| Failure::input(format!("cannot write to {}: {error}", folder.display()));
    std::fs::create_dir_all(folder).map_err(failed)?;
    clap_mangen::generate_to(Cli::command(), folder).map_err(failed)?;
    tell(&format!(
        "read them with `man -l {}`\n",
        folder.join("cortex.1").display()
    ));
    Ok(Answer::Yes)
}
