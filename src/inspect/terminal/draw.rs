//! The terminal's picture: a pure function of the screen.

use super::lines::Line;
use super::map;
use super::screen::{COMMITS, GRAPH, MAP, Screen, TABS, Told};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line as Text, Span};
use ratatui::widgets::{Block, Clear, List, ListItem, ListState, Paragraph, Tabs, Wrap};

const SOFT: Style = Style::new().fg(Color::DarkGray);
const REVERSED: Style = Style::new().add_modifier(Modifier::REVERSED);

pub(super) fn draw(screen: &Screen, frame: &mut Frame<'_>) {
    let rows = [
        Constraint::Length(1),
        Constraint::Min(3),
        Constraint::Length(1),
        Constraint::Length(1),
    ];
    let [top, middle, state, keys] = Layout::vertical(rows).areas(frame.area());
    let tabs = Tabs::new(TABS).select(screen.tab);
    frame.render_widget(tabs.highlight_style(REVERSED), top);
    match screen.tab {
        GRAPH => draw_graph(screen, frame, middle),
        MAP => map::draw(&screen.map, frame, middle),
        tab => {
            let title = match (tab, screen.ruled) {
                (COMMITS, true) => "commits with rules",
                _ => TABS[tab].split_at(2).1,
            };
            draw_lines(screen, title, Some(screen.chosen()), frame, middle);
        }
    }
    let held = if screen.at.is_some() { "then: " } else { "" };
    frame.render_widget(Text::raw(format!("{held}{}", screen.title)), state);
    let said = match screen.tab {
        _ if screen.told.is_some() => "arrows scroll  any other key closes",
        _ if screen.typing => "type a part of a name or type  enter keeps it  escape shows all",
        GRAPH => "/ filter  enter attributes  w why  h history  , . time  ? keys  q end",
        MAP => ", . time  n now  ? keys  q end",
        COMMITS => "r only rules  enter whole  w why  , . time  ? keys  q end",
        _ => "enter whole  w why  h history  , . time  ? keys  q end",
    };
    frame.render_widget(Text::styled(said, SOFT), keys);
    if let Some(told) = &screen.told {
        draw_told(told, frame, middle);
    }
}

fn draw_graph(screen: &Screen, frame: &mut Frame<'_>, area: Rect) {
    let columns = [Constraint::Percentage(35), Constraint::Percentage(65)];
    let [left, right] = Layout::horizontal(columns).areas(area);
    let cursor = if screen.typing { "_" } else { "" };
    let title = match (screen.filter.as_str(), screen.typing) {
        ("", false) => format!("{} nodes", screen.nodes.len()),
        (filter, _) => format!("{} nodes with {filter}{cursor}", screen.nodes.len()),
    };
    let items = screen
        .nodes
        .iter()
        .map(|(_, line)| ListItem::new(line.as_str()));
    let style = if screen.inside.is_none() {
        REVERSED
    } else {
        SOFT
    };
    let list = List::new(items).block(Block::bordered().title(title));
    let mut state = ListState::default().with_selected(Some(screen.chosen()));
    frame.render_stateful_widget(list.highlight_style(style), left, &mut state);
    let name = screen
        .nodes
        .get(screen.chosen())
        .map_or("", |(_, line)| line);
    draw_lines(screen, name, screen.inside, frame, right);
}

fn draw_lines(
    screen: &Screen,
    title: &str,
    chosen: Option<usize>,
    frame: &mut Frame<'_>,
    area: Rect,
) {
    let width = usize::from(area.width.saturating_sub(2));
    let items = screen
        .lines
        .iter()
        .map(|line| ListItem::new(fitted(line, width)));
    let list = List::new(items)
        .block(Block::bordered().title(title.to_owned()))
        .highlight_style(REVERSED);
    let mut state = ListState::default().with_selected(chosen);
    frame.render_stateful_widget(list, area, &mut state);
}

/// A line cut so that what is to stay in sight does.
fn fitted(line: &Line, width: usize) -> Text<'static> {
    let after = match line.after.as_str() {
        "" => String::new(),
        after => format!("  {after}"),
    };
    let room = width.saturating_sub(after.chars().count());
    let text = line.text.replace('\n', " ");
    let text = if text.chars().count() > room {
        let kept: String = text.chars().take(room.saturating_sub(1)).collect();
        format!("{kept}\u{2026}")
    } else {
        text
    };
    let style = if line.is_heading {
        Style::new().add_modifier(Modifier::BOLD)
    } else {
        Style::new()
    };
    Text::from(vec![Span::styled(text, style), Span::styled(after, SOFT)])
}

fn draw_told(told: &Told, frame: &mut Frame<'_>, area: Rect) {
    let text = Paragraph::new(told.text.as_str()).wrap(Wrap { trim: false });
    let text = text.block(Block::bordered().title(told.title.as_str()));
    frame.render_widget(Clear, area);
    frame.render_widget(text.scroll((told.scrolled, 0)), area);
}
