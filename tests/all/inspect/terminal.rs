//! The inspector in a terminal of its own, which `script` (of Debian's essential packages) makes: keys go in,
//! what is drawn comes out.

use super::{Ending, Inspected, PATIENCE};
use crate::support::within;
use dsr::{Time, Transaction};
use std::io::{Read, Write};
use std::process::{ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};

/// A terminal with the inspector in it.
struct Terminal {
    process: Ending,
    keys: ChildStdin,
    screen: Receiver<Vec<u8>>,
    said: String,
}

impl Terminal {
    fn open(inspected: &Inspected, [columns, rows]: [u16; 2]) -> Option<Self> {
        let program = env!("CARGO_BIN_EXE_cortex-under-test");
        let instance = inspected.session.instance().name();
        // Its settings before and after; what it says last is how it ended.
        let line = format!(
            "stty cols {columns} rows {rows}; echo before $(stty -g) end; {program} inspect --tui --instance {instance}; \
             echo code $? after $(stty -g) end"
        );
        let process = Command::new("script")
            .args(["-qfc", &line, "/dev/null"])
            .env("TERM", "xterm-256color")
            .env("SHELL", "/bin/sh")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn();
        let mut process = process.ok()?;
        let (keys, screen) = (process.stdin.take(), process.stdout.take());
        let (send, drawn) = channel();
        std::thread::spawn(move || {
            let (mut screen, mut buffer) = (screen.unwrap(), [0; 4096]);
            while let Ok(count @ 1..) = screen.read(&mut buffer)
                && send.send(buffer[..count].to_vec()).is_ok()
            {}
        });
        Some(Self {
            process: Ending(process),
            keys: keys.unwrap(),
            screen: drawn,
            said: String::new(),
        })
    }

    /// Reads until what was said, or what is drawn, has a text in it.
    fn until(&mut self, text: &str) {
        // It draws all the time: what does not come is not waited for by its silence.
        let came = within(PATIENCE, || {
            for drawn in self.screen.try_iter() {
                self.said.push_str(&String::from_utf8_lossy(&drawn));
            }
            (self.said.contains(text) || self.drawn().contains(text)).then_some(())
        });
        assert!(came.is_some(), "no `{text}` in {}", self.drawn());
    }

    /// The screen's letters, as far as it was told to move to a place and write there.
    fn drawn(&self) -> String {
        let mut cells = vec![vec![' '; 200]; 50];
        let (mut row, mut column) = (0, 0);
        let mut letters = self.said.chars();
        while let Some(letter) = letters.next() {
            if letter == '\u{1b}' {
                let mut order = String::new();
                for letter in letters.by_ref() {
                    order.push(letter);
                    if letter.is_ascii_alphabetic() {
                        break;
                    }
                }
                let place = order
                    .strip_prefix('[')
                    .and_then(|rest| rest.strip_suffix('H'));
                if let Some((to_row, to_column)) = place.and_then(|place| place.split_once(';')) {
                    let place = [to_row, to_column].map(|at| at.parse::<usize>().unwrap() - 1);
                    [row, column] = place;
                }
            } else if !letter.is_control() && row < 50 && column < 200 {
                cells[row][column] = letter;
                column += 1;
            }
        }
        let lines = cells.into_iter().map(String::from_iter);
        lines.collect::<Vec<String>>().join("\n")
    }

    fn keys(&mut self, keys: &str) {
        self.keys.write_all(keys.as_bytes()).unwrap();
    }
}

fn settings<'a>(said: &'a str, word: &str) -> &'a str {
    let rest = said.split_once(word).unwrap().1;
    rest.split_once(" end").unwrap().0
}

#[test]
#[allow(clippy::print_stderr, reason = "a test that did not look must say so")]
fn the_graph_is_looked_at_by_keys_and_the_terminal_is_left_as_it_was() {
    for size in [[80, 24], [200, 50]] {
        let mut inspected = Inspected::new("terminal", 2, &[]);
        let Some(mut terminal) = Terminal::open(&inspected, size) else {
            eprintln!("SKIPPED: there is no `script` that makes a terminal");
            return;
        };
        terminal.until("person_0 : person");
        terminal.keys("/rob");
        terminal.until("max_speed = 0.5");
        terminal.keys("\r\rw");
        terminal.until("why robot.max_speed");
        terminal.keys("x3");
        terminal.until("There are no missions.");
        // What happens meanwhile is seen.
        let mut faster = Transaction::new();
        faster.set("robot", "max_speed", 0.9);
        let time = Time::from_seconds(1010.0);
        inspected.session.commit(&faster, time).unwrap();
        terminal.keys("1");
        terminal.until("max_speed = 0.9");
        terminal.keys("2");
        terminal.until("2 people");
        terminal.keys("q");
        terminal.until("\u{1b}[?1049l");
        terminal.until("after ");
        let told = settings(&terminal.said, "before ").to_owned();
        terminal.until(&format!("code 0 after {told} end"));
        assert!(terminal.process.0.wait().unwrap().success());
    }
}
