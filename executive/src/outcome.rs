//! What planning gives: a plan whose steps are rules at bindings, or why there is none. This file
//! owns the words that the planner and the executive share.

use dsr::NodeId;
use serde::{Deserialize, Serialize};

/// One rule application of a plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanStep {
    /// The rule's name.
    pub rule: String,
    /// The node that each of the rule's variables stands for, in the order of the rule's left-hand
    /// side. A node that an earlier step creates is not here.
    pub binding: Vec<(String, NodeId)>,
    /// What it costs.
    pub cost: f64,
}

/// A plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// In this order.
    pub steps: Vec<PlanStep>,
    /// Sum of the steps' costs.
    pub cost: f64,
    /// Whether no plan is cheaper.
    pub optimal: bool,
}

/// What planning came to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Outcome {
    /// There is a plan; it is empty where the goal holds already.
    Solved(Plan),
    /// There is none, and why.
    Unsolvable {
        /// In words: what cannot be reached and what blocks it.
        reason: String,
    },
    /// None was found before a limit.
    Limit {
        /// Which limit, and how far it came.
        reason: String,
    },
}

/// How to plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Search until no plan can be cheaper.
    pub optimal: bool,
    /// States that may be expanded.
    pub max_expanded: u64,
    /// Bytes that states may take.
    pub max_bytes: u64,
    /// Rule applications that cost extra, because they failed lately: rule, binding, extra cost.
    pub penalties: Vec<(String, Vec<(String, NodeId)>, f64)>,
}

impl Default for Options {
    fn default() -> Self {
        Self { optimal: false, max_expanded: 200_000, max_bytes: 1 << 30, penalties: Vec::new() }
    }
}
