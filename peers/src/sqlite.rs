//! SQLite: nodes and edges as tables, a pattern as one join, with the indices that one usually makes,
//! or with those of somebody who knows what SQLite makes of them.

use crate::Labelled;
use rusqlite::Connection;
use std::fmt::Write as _;
use std::time::Instant;

/// The pattern as a query for the ids of its nodes.
fn select(query: &Labelled) -> String {
    let columns: Vec<String> = (0..query.nodes.len()).map(|n| format!("n{n}.id")).collect();
    let nodes = (0..query.nodes.len()).map(|n| format!("node n{n}"));
    let edges = (0..query.edges.len()).map(|e| format!("edge e{e}"));
    let tables: Vec<String> = nodes.chain(edges).collect();
    let mut text = format!(
        "SELECT {} FROM {} WHERE 1",
        columns.join(", "),
        tables.join(", ")
    );
    // Writing to a string does not fail.
    for (n, kind) in query.nodes.iter().enumerate() {
        let _ = write!(text, " AND n{n}.kind = {kind}");
        for (other, _) in query.nodes[..n]
            .iter()
            .enumerate()
            .filter(|(_, k)| *k == kind)
        {
            let _ = write!(text, " AND n{n}.id <> n{other}.id");
        }
    }
    for (e, (from, label, to)) in query.edges.iter().enumerate() {
        let _ = write!(
            text,
            " AND e{e}.label = {label} AND e{e}.source = n{from}.id AND e{e}.target = n{to}.id"
        );
    }
    text
}

/// Places are far below the largest number that it knows.
fn number(place: usize) -> i64 {
    i64::try_from(place).unwrap_or(i64::MAX)
}

/// How the tables are indexed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Indices {
    /// Each column that a pattern asks for has one.
    Plain,
    /// Edges are found both ways in indices that hold all of them, and SQLite has counted what is in
    /// its tables.
    Tuned,
}

impl Indices {
    fn statements(self) -> &'static str {
        match self {
            Self::Plain => {
                "CREATE INDEX by_kind ON node (kind);
                 CREATE INDEX by_source ON edge (source);
                 CREATE INDEX by_target ON edge (target);"
            }
            Self::Tuned => {
                "CREATE INDEX by_kind ON node (kind);
                 CREATE INDEX forth ON edge (label, source, target);
                 CREATE INDEX back ON edge (label, target, source);
                 ANALYZE;"
            }
        }
    }
}

/// Seconds for all matches (the better of two runs, so that its cache is warm), and how many
/// there are.
pub(crate) fn all(
    data: &Labelled,
    query: &Labelled,
    indices: Indices,
) -> rusqlite::Result<(f64, u64)> {
    let connection = Connection::open_in_memory()?;
    connection.execute_batch(
        "CREATE TABLE node (id INTEGER PRIMARY KEY, kind INTEGER NOT NULL);
         CREATE TABLE edge (label INTEGER NOT NULL, source INTEGER NOT NULL, target INTEGER NOT NULL);
         BEGIN;",
    )?;
    let mut node = connection.prepare("INSERT INTO node VALUES (?1, ?2)")?;
    for (id, kind) in data.nodes.iter().enumerate() {
        node.execute((number(id), kind))?;
    }
    let mut edge = connection.prepare("INSERT INTO edge VALUES (?1, ?2, ?3)")?;
    for (from, label, to) in &data.edges {
        edge.execute((label, number(*from), number(*to)))?;
    }
    connection.execute_batch("COMMIT;")?;
    connection.execute_batch(indices.statements())?;
    let mut statement = connection.prepare(&select(query))?;
    let mut best = f64::INFINITY;
    let mut count = 0;
    for _ in 0..2 {
        let started = Instant::now();
        let mut rows = statement.query([])?;
        count = 0;
        while rows.next()?.is_some() {
            count += 1;
        }
        best = best.min(started.elapsed().as_secs_f64());
    }
    Ok((best, count))
}
