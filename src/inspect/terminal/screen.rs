//! What the terminal shows and what a key does to it. It guarantees that a key asks for nothing itself: what is
//! to be asked is asked at the next look.

use super::lines::{
    Line, commit_line, history_line, mission_lines, node_lines, process_lines, rows, text,
};
use crate::Failure;
use crate::commands::output::clock;
use crate::commands::{graph as commands, why};
use crate::inspect::look::{Looker, Source};
use crate::inspect::news::{Sieve, commits};
use crate::inspect::processes::Processes;
use crate::view::map::Map;
use crate::view::{graph, mission};
use dsr::{NodeId, ReadError, Snapshot, Time};
use ratatui::crossterm::event::KeyCode;
use serde_json::Value as Json;

pub(super) const TABS: [&str; 5] = ["1 Graph", "2 Map", "3 Missions", "4 Agents", "5 Commits"];
pub(super) const GRAPH: usize = 0;
pub(super) const MAP: usize = 1;
pub(super) const MISSIONS: usize = 2;
pub(super) const AGENTS: usize = 3;
pub(super) const COMMITS: usize = 4;

/// So many commits are listed.
const KEPT: usize = 200;
/// Entries of a history.
const HISTORY: usize = 200;
/// Looks between two at the processes.
const PROCESSES_EVERY: u64 = 5;

/// Whether the user has seen enough.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Next {
    Go,
    End,
}

/// Something that is to be asked of the program.
#[derive(Debug, Clone)]
enum Question {
    Why(String),
    History(String),
}

/// A text over the rest, such as an answer.
#[derive(Debug, Clone, Default)]
pub(super) struct Told {
    pub(super) title: String,
    pub(super) text: String,
    pub(super) scrolled: u16,
}

/// What the screen shows.
#[derive(Default)]
pub(super) struct Screen {
    pub(super) title: String,
    pub(super) tab: usize,
    /// The part of a name or type that nodes must have.
    pub(super) filter: String,
    pub(super) typing: bool,
    /// As of when, where not of now.
    pub(super) at: Option<f64>,
    range: [f64; 2],
    /// Of the commits, only those with rules.
    pub(super) ruled: bool,
    pub(super) nodes: Vec<(NodeId, String)>,
    /// Which line of each view is chosen.
    chosen: [usize; TABS.len()],
    /// Whether the keys go through the node's attributes and edges, and to which.
    pub(super) inside: Option<usize>,
    /// The attributes and edges of the chosen node, or the lines of another view.
    pub(super) lines: Vec<Line>,
    pub(super) map: Map,
    pub(super) told: Option<Told>,
    question: Option<Question>,
    processes: Option<Processes>,
    rows: Json,
    looks: u64,
}

impl Screen {
    pub(super) fn of(looker: &mut Looker) -> Result<Self, Failure> {
        let processes = match &looker.source {
            Source::Live(session) => Some(Processes::of(session.instance())),
            Source::Recording(_) => None,
        };
        let mut screen = Self {
            processes,
            ..Self::default()
        };
        screen.look(looker)?;
        Ok(screen)
    }

    pub(super) fn chosen(&self) -> usize {
        self.chosen[self.tab]
    }

    /// Takes in what is new, and asks what is to be asked.
    pub(super) fn look(&mut self, looker: &mut Looker) -> Result<(), Failure> {
        self.range = looker.range()?.map(Time::seconds);
        let snapshot = looker.at(self.at)?;
        let [_, newest] = self.range;
        let passed = match self.at {
            None => String::new(),
            Some(_) => format!(" ({:.1} s)", snapshot.time().seconds() - newest),
        };
        self.title = format!(
            "{}{passed}, version {}, {} nodes, {} edges",
            clock(snapshot.time()),
            snapshot.version(),
            snapshot.node_count(),
            snapshot.edge_count()
        );
        if let Some(processes) = &mut self.processes
            && self.looks.is_multiple_of(PROCESSES_EVERY)
        {
            self.rows = processes.look(&snapshot);
        }
        self.looks += 1;
        // What is overtaken in the middle of a look is looked at again in the next.
        match self.take_in(&snapshot) {
            Ok(()) | Err(ReadError::SnapshotTooOld { .. }) => {}
            Err(error) => return Err(Failure::internal(error)),
        }
        if let Some(question) = self.question.take() {
            self.told = Some(answer(&snapshot, &question));
        }
        Ok(())
    }

    fn take_in(&mut self, snapshot: &Snapshot) -> Result<(), ReadError> {
        match self.tab {
            GRAPH => {
                self.nodes = self.matching(snapshot)?;
                let last = self.nodes.len().saturating_sub(1);
                self.chosen[GRAPH] = self.chosen[GRAPH].min(last);
                let node = match self.nodes.get(self.chosen[GRAPH]) {
                    Some((id, _)) => graph::node(snapshot, *id)?,
                    None => None,
                };
                self.lines = node_lines(&node.unwrap_or_default());
                let last = self.lines.len().saturating_sub(1);
                self.inside = self.inside.map(|at| at.min(last));
                return Ok(());
            }
            MAP => self.map = Map::of(snapshot)?,
            MISSIONS => self.lines = mission_lines(&mission::missions(snapshot)?),
            AGENTS => self.lines = process_lines(&self.rows, snapshot.time().seconds()),
            _ => {
                let sieve = Sieve {
                    rules: self.ruled,
                    agent: None,
                };
                let commits = commits(snapshot, &sieve, KEPT);
                self.lines = commits.iter().map(commit_line).collect();
            }
        }
        let last = self.lines.len().saturating_sub(1);
        self.chosen[self.tab] = self.chosen[self.tab].min(last);
        Ok(())
    }

    fn matching(&self, snapshot: &Snapshot) -> Result<Vec<(NodeId, String)>, ReadError> {
        let part = self.filter.to_lowercase();
        let mut found = Vec::new();
        for node in snapshot.nodes() {
            let node = node?;
            let line = format!("{} : {}", node.name()?, node.type_name());
            if line.to_lowercase().contains(&part) {
                found.push((node.id(), line));
            }
        }
        found.sort_by(|a, b| a.1.cmp(&b.1));
        Ok(found)
    }

    /// Does what a key says.
    pub(super) fn key(&mut self, key: KeyCode) -> Next {
        if self.typing {
            match key {
                KeyCode::Enter => self.typing = false,
                KeyCode::Esc => {
                    self.typing = false;
                    self.filter.clear();
                }
                KeyCode::Backspace => drop(self.filter.pop()),
                KeyCode::Char(letter) => self.filter.push(letter),
                _ => {}
            }
            return Next::Go;
        }
        if let Some(told) = &mut self.told {
            match key {
                KeyCode::Down | KeyCode::Char('j') => told.scrolled += 1,
                KeyCode::Up | KeyCode::Char('k') => told.scrolled = told.scrolled.saturating_sub(1),
                KeyCode::PageDown => told.scrolled += 10,
                KeyCode::PageUp => told.scrolled = told.scrolled.saturating_sub(10),
                _ => self.told = None,
            }
            return Next::Go;
        }
        match key {
            KeyCode::Char('q') => return Next::End,
            KeyCode::Esc if self.inside.take().is_none() => return Next::End,
            KeyCode::Char('/') => {
                (self.typing, self.tab, self.inside) = (true, GRAPH, None);
                self.filter.clear();
            }
            KeyCode::Char('?') => self.told = Some(help()),
            KeyCode::Char('p') => self.hold(),
            KeyCode::Char('n') => self.at = None,
            KeyCode::Char(',') => self.go(-1.0),
            KeyCode::Char('.') => self.go(1.0),
            KeyCode::Char('<') => self.go(-10.0),
            KeyCode::Char('>') => self.go(10.0),
            KeyCode::Char('r') => self.ruled = !self.ruled,
            KeyCode::Char('w') => self.question = self.path().map(Question::Why),
            KeyCode::Char('h') => self.question = self.path().map(Question::History),
            KeyCode::Char(digit @ '1'..='5') => self.turn_to(digit as usize - '1' as usize),
            KeyCode::Tab => self.turn_to((self.tab + 1) % TABS.len()),
            KeyCode::BackTab => self.turn_to((self.tab + TABS.len() - 1) % TABS.len()),
            KeyCode::Enter | KeyCode::Right if self.tab == GRAPH && self.inside.is_none() => {
                self.inside = Some(0);
            }
            KeyCode::Left => self.inside = None,
            KeyCode::Enter => {
                self.told = self.lines.get(self.place()).map(|line| Told {
                    text: format!("{}\n{}", line.text, line.after),
                    ..Told::default()
                });
            }
            KeyCode::Down | KeyCode::Char('j') => self.step(1),
            KeyCode::Up | KeyCode::Char('k') => self.step(-1),
            KeyCode::PageDown => self.step(20),
            KeyCode::PageUp => self.step(-20),
            KeyCode::Home => self.step(isize::MIN / 2),
            KeyCode::End => self.step(isize::MAX / 2),
            _ => {}
        }
        Next::Go
    }

    fn turn_to(&mut self, tab: usize) {
        (self.tab, self.inside) = (tab, None);
        self.lines.clear();
    }

    /// Which line the keys are at.
    fn place(&self) -> usize {
        self.inside.unwrap_or(self.chosen[self.tab])
    }

    fn step(&mut self, by: isize) {
        let lines = match (self.tab, self.inside) {
            (GRAPH, None) => self.nodes.len(),
            _ => self.lines.len(),
        };
        let at = self.place().saturating_add_signed(by);
        let at = at.min(lines.saturating_sub(1));
        match &mut self.inside {
            Some(inside) => *inside = at,
            None => self.chosen[self.tab] = at,
        }
    }

    /// What *why* and *history* are of.
    fn path(&self) -> Option<String> {
        if let (GRAPH, None) = (self.tab, self.inside) {
            let (_, line) = self.nodes.get(self.chosen[GRAPH])?;
            return line.rsplit_once(" : ").map(|(name, _)| name.to_owned());
        }
        self.lines.get(self.place())?.path.clone()
    }

    fn hold(&mut self) {
        self.at = match self.at {
            None => Some(self.range[1]),
            Some(_) => None,
        };
    }

    fn go(&mut self, seconds: f64) {
        let [oldest, newest] = self.range;
        let at = self.at.unwrap_or(newest) + seconds;
        self.at = (at < newest).then_some(at.max(oldest));
    }
}

fn answer(snapshot: &Snapshot, question: &Question) -> Told {
    let (title, text) = match question {
        Question::Why(path) => {
            let told = why::explain(snapshot, Some(path));
            (format!("why {path}"), told.map(|told| text(&told["text"])))
        }
        Question::History(path) => {
            let told = commands::history_rows(snapshot, path, Some(HISTORY));
            let lines = told.map(|told| rows(&told["entries"]).map(history_line).collect());
            (format!("history of {path}"), lines)
        }
    };
    let text = text.unwrap_or_else(|failure| {
        let report = failure.into_report();
        let help = report.help().map(|help| format!("\n{help}"));
        format!("{report}{}", help.unwrap_or_default())
    });
    Told {
        title,
        text,
        scrolled: 0,
    }
}

fn help() -> Told {
    Told {
        title: "keys".to_owned(),
        text: "1 to 5, tab        a view\n\
               arrows, j k        choose a line; page up, page down, home, end\n\
               enter, right       into a node's attributes and edges; left comes back\n\
               enter              the whole of a line\n\
               /                  only nodes with a word in name or type; escape shows all\n\
               w                  why the line is so\n\
               h                  its history\n\
               r                  commits: only those with rules\n\
               , .  < >           a second, ten seconds back and on\n\
               p                  hold the time, and let it go\n\
               n                  now\n\
               q                  end"
            .to_owned(),
        scrolled: 0,
    }
}
