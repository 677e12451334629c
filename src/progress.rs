//! What a long verb shows while it works: a bar on a terminal, lines elsewhere; always on standard
//! error, so that standard output holds only the answer.

use crate::commands::output::tell;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;

#[derive(Debug)]
pub(crate) struct Progress {
    title: String,
    bar: Option<ProgressBar>,
    quiet: bool,
}

impl Progress {
    /// Progress of something called `title`; `quiet` shows nothing.
    pub(crate) fn new(title: &str, quiet: bool) -> Self {
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::new(1);
            let style = "{prefix} [{bar:30}] {msg}";
            if let Ok(style) = ProgressStyle::with_template(style) {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.set_prefix(title.to_owned());
            bar
        });
        Self {
            title: title.to_owned(),
            bar,
            quiet,
        }
    }

    /// Something happened that is worth a line.
    pub(crate) fn say(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.println(format!("{}: {line}", self.title)),
            None if !self.quiet => tell(&format!("{}: {line}\n", self.title)),
            None => {}
        }
    }

    /// `now` of at most `end` simulated seconds have passed.
    pub(crate) fn at(&self, now: f64, end: f64, what: &str) {
        if let Some(bar) = &self.bar {
            bar.set_length(end.max(1.0) as u64);
            bar.set_position(now.max(0.0) as u64);
            bar.set_message(format!("{now:5.1} s of at most {end:.0} s  {what}"));
        }
    }

    /// So many of `all` are done, of which this was one: on a terminal a bar, elsewhere a line for each tenth.
    pub(crate) fn count(&self, done: usize, all: usize) {
        if let Some(bar) = &self.bar {
            bar.set_length(all.max(1) as u64);
            bar.set_position(done as u64);
            bar.set_message(format!("{done} of {all}"));
        } else if done * 10 / all.max(1) > (done - 1) * 10 / all.max(1) {
            self.say(&format!("{done} of {all}"));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
