//! `cortex inspect`: a running instance or a recording, for people to look at.

use super::output::{print, tell};
use crate::cli::Inspect as Arguments;
use crate::inspect::{Options, Source, serve, show};
use crate::manifests::INSPECTOR;
use crate::recording;
use crate::{Answer, Failure};
use dsr::{Pace, Session, Turns};
use std::fmt::Write as _;
use std::io::Read;
use std::net::SocketAddr;
use std::time::Duration;

/// How long to wait for an instance that may be starting.
const PATIENCE: Duration = Duration::from_secs(5);

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let stop = super::interruption()?;
    let pace = if arguments.supervised {
        Pace::Free
    } else {
        Pace::Alone
    };
    let instance = super::instance(&arguments.instance)?;
    if arguments.file.is_none() && !instance.exists() {
        return Err(super::not_running(instance.name()));
    }
    let mut turns = Turns::begin(pace, stop).map_err(Failure::internal)?;
    let (watched, file) = (instance.clone(), arguments.file.clone());
    let opener = move || match file {
        Some(file) => {
            let graph = recording::played(&file, None).map_err(Failure::input)?;
            Ok(Source::Recording(Box::new(graph)))
        }
        None => {
            let session = Session::attach(&instance, INSPECTOR, PATIENCE);
            Ok(Source::Live(Box::new(session.map_err(Failure::internal)?)))
        }
    };
    let of_file = arguments.file.is_some();
    let ended = || turns.ended() || !of_file && !watched.exists();
    match arguments.web {
        _ if arguments.tui => show(opener()?, ended)?,
        Some(address) => {
            let token = arguments.allow_edit.then(token).transpose()?;
            let options = Options { address, token };
            let token = options.token.clone();
            let tell = |address| tell_address(address, token.as_deref(), pace);
            serve(&options, Box::new(opener), tell, ended)?;
        }
        None => {
            return Err(Failure::input_with_help(
                "say how to look at it",
                "in a browser: --web; in this terminal: --tui",
            ));
        }
    }
    Ok(Answer::Yes)
}

fn tell_address(address: SocketAddr, token: Option<&str>, pace: Pace) {
    let token = token.map_or_else(String::new, |token| format!("#token={token}"));
    let line = format!("http://{address}/{token}\n");
    if pace == Pace::Free {
        // Standard output is for the supervisor.
        tell(&line);
    } else {
        // Nothing is lost where nobody reads it.
        drop(print(&line));
    }
}

/// Sixteen random bytes of the operating system's, in hexadecimal.
fn token() -> Result<String, Failure> {
    let mut bytes = [0; 16];
    let read = std::fs::File::open("/dev/urandom").and_then(|mut file| file.read_exact(&mut bytes));
    read.map_err(Failure::internal)?;
    let mut text = String::new();
    for byte in bytes {
        // Writing to a string does not fail.
        let _ = write!(text, "{byte:02x}");
    }
    Ok(text)
}
