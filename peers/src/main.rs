//! Finds the matches of a pattern with other engines, for `cortex bench rules`: a program of its
//! own, because SQLite alone takes longer to compile than Cortex.
//!
//! `cortex-peers vf2|sqlite|sqlite_tuned WORLD PATTERN` prints the seconds that all matches took (loading and
//! indexing not counted) and how many there are. A world is lines `n TYPE`, from id 1 on, and
//! `e FROM LABEL TO`; a pattern is words `VARIABLE:TYPE` and `FROM-LABEL-TO`.
#![forbid(unsafe_code)]
#![allow(
    clippy::disallowed_methods,
    reason = "measuring takes the host's clock"
)]

mod sqlite;
mod vf2_crate;

use sqlite::Indices;
use std::error::Error;
use std::io::Write;
use std::process::ExitCode;

/// A labelled graph: types of nodes, and edges (from, label, to) between their places. Types and
/// labels are numbers, as every engine likes them best.
#[derive(Debug, Default)]
struct Labelled {
    nodes: Vec<u32>,
    edges: Vec<(usize, u32, usize)>,
}

/// Numbers for names.
#[derive(Debug, Default)]
struct Names(Vec<String>);

impl Names {
    fn number(&mut self, name: &str) -> u32 {
        let known = self.0.iter().position(|known| known == name);
        known.unwrap_or_else(|| {
            self.0.push(name.to_owned());
            self.0.len() - 1
        }) as u32
    }
}

fn world(text: &str, names: &mut Names) -> Option<Labelled> {
    let mut graph = Labelled::default();
    for line in text.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        match words[..] {
            ["n", kind] => graph.nodes.push(names.number(kind)),
            ["e", from, label, to] => {
                let place = |id: &str| id.parse::<usize>().ok()?.checked_sub(1);
                let (from, to) = (place(from)?, place(to)?);
                graph.edges.push((from, names.number(label), to));
            }
            _ => return None,
        }
    }
    Some(graph)
}

fn pattern(text: &str, names: &mut Names) -> Option<Labelled> {
    let mut graph = Labelled::default();
    let mut variables = Vec::new();
    for word in text.split_whitespace() {
        if let Some((variable, kind)) = word.split_once(':') {
            variables.push(variable);
            graph.nodes.push(names.number(kind));
        } else {
            let ends: Vec<&str> = word.split('-').collect();
            let [from, label, to] = ends[..] else {
                return None;
            };
            let place = |end: &str| variables.iter().position(|variable| *variable == end);
            graph
                .edges
                .push((place(from)?, names.number(label), place(to)?));
        }
    }
    Some(graph)
}

fn measure() -> Result<(f64, u64), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [engine, file, query] = &arguments[..] else {
        return Err("usage: cortex-peers vf2|sqlite|sqlite_tuned WORLD PATTERN".into());
    };
    let mut names = Names::default();
    let data = world(&std::fs::read_to_string(file)?, &mut names).ok_or("not a world")?;
    let query = pattern(query, &mut names).ok_or("not a pattern")?;
    match engine.as_str() {
        "vf2" => Ok(vf2_crate::all(&data, &query)),
        "sqlite" => Ok(sqlite::all(&data, &query, Indices::Plain)?),
        "sqlite_tuned" => Ok(sqlite::all(&data, &query, Indices::Tuned)?),
        other => Err(format!("no engine `{other}`").into()),
    }
}

fn main() -> ExitCode {
    match measure() {
        Ok((seconds, count)) => {
            let said = writeln!(std::io::stdout(), "{seconds} {count}");
            ExitCode::from(u8::from(said.is_err()))
        }
        Err(error) => {
            drop(writeln!(std::io::stderr(), "{error}"));
            ExitCode::from(2)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_engines_find_the_same() {
        let text = "n room\nn room\nn room\nn robot\ne 1 connected 2\ne 2 connected 1\n\
                    e 2 connected 3\ne 3 connected 2\ne 4 in 2\n";
        let mut names = Names::default();
        let data = world(text, &mut names).unwrap();
        let query = pattern("r:robot a:room b:room r-in-a a-connected-b", &mut names).unwrap();
        assert_eq!(vf2_crate::all(&data, &query).1, 2);
        for indices in [Indices::Plain, Indices::Tuned] {
            assert_eq!(sqlite::all(&data, &query, indices).unwrap().1, 2);
        }
    }
}
