//! The flags of `cortex path`. Parsing a flag does nothing but parse it.

use clap::{Args, ValueEnum};
use std::path::PathBuf;

#[derive(Debug, Clone, Args)]
#[command(group = clap::ArgGroup::new("grid_source").required(true))]
pub(crate) struct Path {
    /// A `MovingAI` map
    #[arg(long, value_name = "F.map", group = "grid_source")]
    pub(crate) map: Option<PathBuf>,
    /// A map with a cost a cell
    #[arg(long, value_name = "F.wmap", group = "grid_source")]
    pub(crate) grid: Option<PathBuf>,
    /// Problems with their optimal lengths, each of which is checked
    #[arg(long, value_name = "F.scen", requires = "map", conflicts_with_all = ["from", "to"])]
    pub(crate) scen: Option<PathBuf>,
    /// Where the path begins
    #[arg(long, value_name = "X,Y", value_parser = cell, required_unless_present = "scen")]
    pub(crate) from: Option<(usize, usize)>,
    /// Where it ends
    #[arg(long, value_name = "X,Y", value_parser = cell, required_unless_present = "scen")]
    pub(crate) to: Option<(usize, usize)>,
    /// What a step costs
    #[arg(long, value_enum, default_value_t = CostModel::LengthMean)]
    pub(crate) model: CostModel,
    /// How the search orders the cells it looks at; the cost is the same
    #[arg(long, value_enum, default_value_t = PathAlgorithm::AStar)]
    pub(crate) algorithm: PathAlgorithm,
    /// For machines
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub(crate) enum CostModel {
    /// Length times the mean cost of both cells
    LengthMean,
    /// Length times the cost of the cell stepped on
    LengthDest,
    /// The cost of each cell on the path
    NodeSum,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PathAlgorithm {
    /// By cost so far
    Dijkstra,
    /// By cost so far and the least that can remain
    #[value(name = "astar")]
    AStar,
    /// The search of a planner that goes on with it when the map changes (D* Lite)
    #[value(name = "dstar_lite")]
    DStarLite,
}

fn cell(text: &str) -> Result<(usize, usize), String> {
    let cell = text.split_once(',');
    let cell = cell.and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
    cell.ok_or_else(|| "a cell is X,Y: two whole numbers from 0".to_owned())
}
