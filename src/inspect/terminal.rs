//! The inspector in a terminal: nodes with their attributes, missions, processes and what happens, over
//! ssh as well. What is drawn is a pure function of the screen's state; it guarantees that the terminal
//! is left as it was found.

use super::frame::Frames;
use super::look::{Looker, Source};
use crate::Failure;
use crate::commands::output::clock;
use crate::view::{graph, mission};
use dsr::{NodeId, Time};
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, List, ListItem, ListState, Paragraph, Tabs, Wrap};
use ratatui::{DefaultTerminal, Frame};
use serde_json::Value as Json;
use std::collections::VecDeque;
use std::time::Duration;

/// How often the screen is drawn anew at the least.
const PERIOD: Duration = Duration::from_millis(200);
/// So many commits are kept to look at.
const KEPT: usize = 500;
const TABS: [&str; 4] = ["1 Nodes", "2 Missions", "3 Processes", "4 Commits"];

/// What the screen shows.
#[derive(Debug, Default)]
pub(super) struct Screen {
    title: String,
    tab: usize,
    /// The part of a name or type that nodes must have.
    filter: String,
    typing: bool,
    paused: bool,
    chosen: usize,
    nodes: Vec<(NodeId, String)>,
    node: Json,
    missions: Json,
    processes: Json,
    commits: VecDeque<String>,
}

/// Shows a graph in this terminal until the user has seen enough or it is over.
///
/// # Errors
/// [`Failure`].
pub(crate) fn show(source: Source, mut ended: impl FnMut() -> bool) -> Result<(), Failure> {
    let mut looker = Looker::new(source);
    let mut frames = Frames::follow(&mut looker)?;
    let mut screen = Screen::default();
    let mut terminal = ratatui::try_init().map_err(Failure::internal)?;
    let shown = run(
        &mut terminal,
        &mut looker,
        &mut frames,
        &mut screen,
        &mut ended,
    );
    ratatui::restore();
    shown
}

fn run(
    terminal: &mut DefaultTerminal,
    looker: &mut Looker,
    frames: &mut Option<Frames>,
    screen: &mut Screen,
    ended: &mut dyn FnMut() -> bool,
) -> Result<(), Failure> {
    while !ended() {
        if !screen.paused {
            screen.look(looker, frames.as_mut())?;
        }
        terminal
            .draw(|frame| screen.draw(frame))
            .map_err(Failure::internal)?;
        if !event::poll(PERIOD).map_err(Failure::internal)? {
            continue;
        }
        if let Event::Key(key) = event::read().map_err(Failure::internal)?
            && key.kind == KeyEventKind::Press
        {
            let control = key.modifiers.contains(KeyModifiers::CONTROL);
            if control && key.code == KeyCode::Char('c') || screen.key(key.code) {
                return Ok(());
            }
        }
    }
    Ok(())
}

impl Screen {
    /// Takes in what is new.
    fn look(&mut self, looker: &mut Looker, frames: Option<&mut Frames>) -> Result<(), Failure> {
        if let Some(frames) = frames
            && let Some(mut frame) = frames.next(looker)?
        {
            if frame["processes"].is_array() {
                self.processes = frame["processes"].take();
            }
            for commit in frame["commits"].as_array().into_iter().flatten() {
                self.commits.push_front(commit_line(commit));
            }
            self.commits.truncate(KEPT);
        }
        let snapshot = looker.newest()?;
        self.title = format!(
            "version {}, {:.1} s, {} nodes, {} edges",
            snapshot.version(),
            snapshot.time().seconds(),
            snapshot.node_count(),
            snapshot.edge_count()
        );
        // What is overtaken in the middle of a look is looked at again in the next.
        if let Ok(nodes) = self.matching(&snapshot) {
            self.nodes = nodes;
        }
        self.chosen = self.chosen.min(self.nodes.len().saturating_sub(1));
        if let Ok(missions) = mission::missions(&snapshot) {
            self.missions = missions;
        }
        self.node = match self.nodes.get(self.chosen) {
            Some((id, _)) => graph::node(&snapshot, *id)
                .ok()
                .flatten()
                .unwrap_or_default(),
            None => Json::Null,
        };
        Ok(())
    }

    fn matching(&self, snapshot: &dsr::Snapshot) -> Result<Vec<(NodeId, String)>, dsr::ReadError> {
        let mut found = Vec::new();
        for node in snapshot.nodes() {
            let node = node?;
            let line = format!("{} : {}", node.name()?, node.type_name());
            if line.contains(&self.filter) {
                found.push((node.id(), line));
            }
        }
        found.sort_by(|a, b| a.1.cmp(&b.1));
        Ok(found)
    }

    /// Does what a key says; whether the user has seen enough.
    fn key(&mut self, key: KeyCode) -> bool {
        match key {
            KeyCode::Enter | KeyCode::Esc if self.typing => self.typing = false,
            KeyCode::Backspace if self.typing => drop(self.filter.pop()),
            KeyCode::Char(letter) if self.typing => self.filter.push(letter),
            KeyCode::Char('q') | KeyCode::Esc => return true,
            KeyCode::Char('/') => {
                (self.typing, self.tab) = (true, 0);
                self.filter.clear();
            }
            KeyCode::Char('p') => self.paused = !self.paused,
            KeyCode::Char(digit @ '1'..='4') => self.tab = digit as usize - '1' as usize,
            KeyCode::Tab | KeyCode::Right => self.tab = (self.tab + 1) % TABS.len(),
            KeyCode::Left => self.tab = (self.tab + TABS.len() - 1) % TABS.len(),
            KeyCode::Down | KeyCode::Char('j') => self.chosen += 1,
            KeyCode::Up | KeyCode::Char('k') => self.chosen = self.chosen.saturating_sub(1),
            KeyCode::PageDown => self.chosen += 20,
            KeyCode::PageUp => self.chosen = self.chosen.saturating_sub(20),
            _ => {}
        }
        self.chosen = self.chosen.min(self.nodes.len().saturating_sub(1));
        false
    }

    fn draw(&self, frame: &mut Frame<'_>) {
        let rows = [
            Constraint::Length(1),
            Constraint::Min(3),
            Constraint::Length(1),
        ];
        let [top, middle, bottom] = Layout::vertical(rows).areas(frame.area());
        let tabs = Tabs::new(TABS).select(self.tab);
        frame.render_widget(tabs.highlight_style(Style::new().fg(Color::Cyan)), top);
        match self.tab {
            0 => self.draw_nodes(frame, middle),
            1 => frame.render_widget(paragraph(mission_lines(&self.missions)), middle),
            2 => frame.render_widget(paragraph(process_lines(&self.processes)), middle),
            _ => {
                let lines = self.commits.iter().map(|line| Line::raw(line.as_str()));
                frame.render_widget(paragraph(lines.collect()), middle);
            }
        }
        let state = if self.paused { "paused; " } else { "" };
        let keys = "/ filter  p pause  tab view  arrows choose  q quit";
        let line = format!("{state}{}    {keys}", self.title);
        frame.render_widget(Line::styled(line, Style::new().fg(Color::DarkGray)), bottom);
    }

    fn draw_nodes(&self, frame: &mut Frame<'_>, area: ratatui::layout::Rect) {
        let columns = [Constraint::Percentage(35), Constraint::Percentage(65)];
        let [left, right] = Layout::horizontal(columns).areas(area);
        let cursor = if self.typing { "_" } else { "" };
        let title = match (self.filter.as_str(), self.typing) {
            ("", false) => format!("{} nodes", self.nodes.len()),
            (filter, _) => format!("{} nodes with {filter}{cursor}", self.nodes.len()),
        };
        let items = self
            .nodes
            .iter()
            .map(|(_, line)| ListItem::new(line.as_str()));
        let list = List::new(items)
            .block(Block::bordered().title(title))
            .highlight_style(Style::new().add_modifier(Modifier::REVERSED));
        let mut state = ListState::default().with_selected(Some(self.chosen));
        frame.render_stateful_widget(list, left, &mut state);
        let block = Block::bordered().title(text(&self.node["name"]));
        frame.render_widget(paragraph(node_lines(&self.node)).block(block), right);
    }
}

fn paragraph(lines: Vec<Line<'_>>) -> Paragraph<'_> {
    Paragraph::new(lines).wrap(Wrap { trim: false })
}

fn text(json: &Json) -> String {
    json.as_str().unwrap_or_default().to_owned()
}

fn rows(json: &Json) -> impl Iterator<Item = &Json> {
    json.as_array().into_iter().flatten()
}

fn commit_line(commit: &Json) -> String {
    let rules: Vec<String> = rows(&commit["rules"]).map(text).collect();
    let time = commit["time"].as_f64().unwrap_or_default();
    let agent = text(&commit["agent"]);
    let mut what: Vec<String> = rows(&commit["what"]).map(text).collect();
    if let Some(more @ 1..) = commit["more"].as_u64() {
        what.push(format!("and {more} more"));
    }
    let what = what.join(", ");
    let time = clock(Time::from_seconds(time));
    format!("{time} {agent} {} {what}", rules.join(" "))
}

fn node_lines(node: &Json) -> Vec<Line<'static>> {
    let soft = Style::new().fg(Color::DarkGray);
    let attribute = |row: &Json| {
        let age = row["age"].as_f64().unwrap_or_default();
        let value: String = text(&row["text"]).chars().take(200).collect();
        Line::from(vec![
            Span::styled(
                format!("{} = ", text(&row["name"])),
                Style::new().fg(Color::Cyan),
            ),
            Span::raw(value),
            Span::styled(format!("  {}, {age:.1} s ago", text(&row["writer"])), soft),
        ])
    };
    let edge = |row: &Json| {
        let (from, label, to) = (text(&row["from"]), text(&row["label"]), text(&row["to"]));
        Line::raw(format!("{from} -{label}-> {to}"))
    };
    let attributes = rows(&node["attributes"]).map(attribute);
    attributes.chain(rows(&node["edges"]).map(edge)).collect()
}

fn mission_lines(missions: &Json) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    for mission in rows(missions) {
        let (name, status) = (text(&mission["name"]), text(&mission["status"]));
        let heading = format!("{name}: {status} {}", text(&mission["reason"]));
        lines.push(Line::styled(
            heading,
            Style::new().add_modifier(Modifier::BOLD),
        ));
        for step in rows(&mission["steps"]) {
            let bound = step["binding"].as_object().into_iter().flatten();
            let bound: Vec<String> = bound
                .map(|(var, node)| format!("{var}={}", text(node)))
                .collect();
            let (rule, agent, status) = (
                text(&step["rule"]),
                text(&step["agent"]),
                text(&step["status"]),
            );
            let reason = text(&step["reason"]);
            let line = format!(
                "  {status:10} {rule}({}) by {agent} {reason}",
                bound.join(", ")
            );
            lines.push(Line::raw(line));
        }
        for decision in rows(&mission["decisions"]) {
            let (what, why) = (text(&decision["what"]), text(&decision["why"]));
            let line = format!("  {what}: {why}");
            lines.push(Line::styled(line, Style::new().fg(Color::DarkGray)));
        }
    }
    if lines.is_empty() {
        lines.push(Line::raw("There are no missions."));
    }
    lines
}

fn process_lines(processes: &Json) -> Vec<Line<'static>> {
    let heading = format!(
        "{:20} {:10} {:>8} {:>8} {:>10}",
        "name", "state", "restarts", "load/%", "memory/MB"
    );
    let process = |row: &Json| {
        let load = 100.0 * row["load"].as_f64().unwrap_or_default();
        let memory = row["memory"].as_f64().unwrap_or_default() / 1e6;
        let restarts = row["restarts"].as_u64().unwrap_or_default();
        let (name, state) = (text(&row["name"]), text(&row["state"]));
        Line::raw(format!(
            "{name:20} {state:10} {restarts:8} {load:8.1} {memory:10.1}"
        ))
    };
    let heading = Line::styled(heading, Style::new().fg(Color::DarkGray));
    std::iter::once(heading)
        .chain(rows(processes).map(process))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsr::{Graph, Schema, Time, Transaction};
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn screen() -> (Looker, Screen) {
        let mut graph = Graph::in_memory(Schema::open());
        let mut transaction = Transaction::new();
        transaction.create_node("robot", "shelly", vec![("max_speed".into(), 0.5.into())]);
        transaction.create_node("room", "kitchen", vec![]);
        transaction.create_edge("shelly", "in", "kitchen");
        graph
            .commit(&transaction, "setup", Time::from_seconds(7.0))
            .unwrap();
        let mut looker = Looker::new(Source::Recording(Box::new(graph)));
        let mut screen = Screen::default();
        screen.look(&mut looker, None).unwrap();
        (looker, screen)
    }

    fn drawn(screen: &Screen) -> String {
        let mut terminal = Terminal::new(TestBackend::new(100, 20)).unwrap();
        terminal.draw(|frame| screen.draw(frame)).unwrap();
        terminal.backend().to_string()
    }

    #[test]
    fn nodes_are_listed_filtered_and_shown_with_writer_and_edges() {
        let (mut looker, mut screen) = screen();
        let text = drawn(&screen);
        assert!(
            text.contains("kitchen : room") && text.contains("2 nodes"),
            "{text}"
        );
        screen.key(KeyCode::Down);
        screen.look(&mut looker, None).unwrap();
        let text = drawn(&screen);
        assert!(text.contains("max_speed = 0.5  setup"), "{text}");
        assert!(text.contains("shelly -in-> kitchen"), "{text}");
        for key in "/kit".chars() {
            assert!(!screen.key(KeyCode::Char(key)));
        }
        screen.look(&mut looker, None).unwrap();
        assert!(drawn(&screen).contains("1 nodes with kit_"));
    }

    #[test]
    fn every_view_can_be_reached_and_the_keys_end_it() {
        let (_, mut screen) = screen();
        screen.key(KeyCode::Char('2'));
        assert!(drawn(&screen).contains("There are no missions."));
        screen.key(KeyCode::Tab);
        assert!(drawn(&screen).contains("restarts"));
        screen.key(KeyCode::Char('p'));
        assert!(drawn(&screen).contains("paused"));
        assert!(screen.key(KeyCode::Char('q')));
    }
}
