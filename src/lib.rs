//! The `cortex` program: its verbs are thin shells around the packages of the workspace.
//!
//! Exit codes: 0 done, 1 the answer is no, 2 bad input, 3 something is broken.
#![forbid(unsafe_code)]

mod bench;
mod cli;
mod commands;
mod conduct;
mod excerpt;
mod inspect;
mod log;
mod manifests;
mod progress;
mod recording;
mod seen;
mod supervise;
mod view;

use clap::Parser;
use miette::Diagnostic;
use std::process::ExitCode;
use thiserror::Error;

/// How a verb ends, where nothing is broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Answer {
    Yes,
    No,
}

/// A report that says that the user's input is at fault, not the program.
#[derive(Debug, Error, Diagnostic)]
#[error("{0}")]
#[diagnostic(code(cortex::input))]
struct BadInput(String, #[help] Option<String>);

/// Runs the program.
pub fn main() -> ExitCode {
    let cli = match cli::Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Printing help can only fail where nobody reads it.
            drop(error.print());
            return ExitCode::from(if error.use_stderr() { 2 } else { 0 });
        }
    };
    tracing_subscriber::fmt()
        .with_env_filter(log::filter(&cli.verb))
        .with_writer(std::io::stderr)
        .with_ansi(false)
        .init();
    // Places in files are for editors to jump to: they stay whole, however long.
    let handler = |_: &_| -> Box<dyn miette::ReportHandler> {
        let handler = miette::MietteHandlerOpts::new().wrap_lines(false).build();
        Box::new(excerpt::Handler(handler))
    };
    // It fails only where there is a handler already, which is as good.
    drop(miette::set_hook(Box::new(handler)));
    match commands::perform(cli.verb) {
        Ok(Answer::Yes) => ExitCode::SUCCESS,
        Ok(Answer::No) => ExitCode::from(1),
        Err(failure) => {
            let code = failure.code();
            print_error(&failure.into_report());
            ExitCode::from(code)
        }
    }
}

/// Where nobody reads the error (`2>&1 | head`), the exit code still tells.
fn print_error(report: &miette::Report) {
    commands::output::tell(&format!("{report:?}\n"));
}

/// Why a verb did not end with an answer.
#[derive(Debug)]
enum Failure {
    /// The input is at fault.
    Input(miette::Report),
    /// The program or the machine is.
    Internal(miette::Report),
}

impl Failure {
    fn code(&self) -> u8 {
        match self {
            Self::Input(_) => 2,
            Self::Internal(_) => 3,
        }
    }

    fn into_report(self) -> miette::Report {
        match self {
            Self::Input(report) | Self::Internal(report) => report,
        }
    }

    fn input(message: impl std::fmt::Display) -> Self {
        Self::Input(BadInput(message.to_string(), None).into())
    }

    fn input_with_help(message: impl std::fmt::Display, help: impl Into<String>) -> Self {
        Self::Input(BadInput(message.to_string(), Some(help.into())).into())
    }

    /// The same, with more help; a report with a place of its own stays as it is.
    fn with_help(self, more: &str) -> Self {
        let Self::Input(report) = self else {
            return self;
        };
        match report.downcast::<BadInput>() {
            Ok(BadInput(message, help)) => {
                let help = help.map_or_else(|| more.to_owned(), |help| format!("{help}; {more}"));
                Self::Input(BadInput(message, Some(help)).into())
            }
            Err(report) => Self::Input(report),
        }
    }

    fn internal(error: impl std::fmt::Display) -> Self {
        Self::Internal(miette::Report::msg(error.to_string()))
    }
}
