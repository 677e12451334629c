//! The inspector in a terminal: the graph, the map, missions, processes and commits, over ssh as well, as of
//! now or of any time that is still known. It guarantees that the terminal is left as it was found.

mod draw;
mod lines;
mod map;
mod screen;
#[cfg(test)]
mod tests;

use super::look::{Looker, Source};
use crate::Failure;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use screen::{Next, Screen};
use std::time::Duration;

/// How often the screen is drawn anew at the least.
const PERIOD: Duration = Duration::from_millis(200);

/// Shows a graph in this terminal until the user has seen enough or it is over.
///
/// # Errors
/// [`Failure`].
pub(crate) fn show(source: Source, mut ended: impl FnMut() -> bool) -> Result<(), Failure> {
    let mut looker = Looker::new(source);
    let mut screen = Screen::of(&mut looker)?;
    let mut terminal = ratatui::try_init().map_err(Failure::internal)?;
    let shown = run(&mut terminal, &mut looker, &mut screen, &mut ended);
    ratatui::restore();
    shown
}

fn run(
    terminal: &mut DefaultTerminal,
    looker: &mut Looker,
    screen: &mut Screen,
    ended: &mut dyn FnMut() -> bool,
) -> Result<(), Failure> {
    while !ended() {
        screen.look(looker)?;
        let drawn = terminal.draw(|frame| draw::draw(screen, frame));
        drawn.map_err(Failure::internal)?;
        // Keys that came together, such as while one is held, are drawn once.
        let mut patience = PERIOD;
        while event::poll(patience).map_err(Failure::internal)? {
            patience = Duration::ZERO;
            if let Event::Key(key) = event::read().map_err(Failure::internal)?
                && key.kind == KeyEventKind::Press
            {
                let control = key.modifiers.contains(KeyModifiers::CONTROL);
                if control && key.code == KeyCode::Char('c') {
                    return Ok(());
                }
                if screen.key(key.code) == Next::End {
                    return Ok(());
                }
            }
        }
    }
    Ok(())
}
