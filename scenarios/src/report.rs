//! What a run came to: `report.json` and the table in the terminal. This file owns the fields of
//! `report/1`; what does not apply or is not finite is null, never a made-up number.
//!
//! Seconds, metres, radians, shares of time in percent.

mod table;
#[cfg(test)]
mod tests;

use crate::metrics::Metrics;
use serde::Serialize;
use std::collections::BTreeMap;

/// The value of [`Report::format`].
pub const FORMAT: &str = "report/1";

/// A run's report.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// [`FORMAT`].
    pub format: &'static str,
    /// The scenario's name.
    pub scenario: String,
    /// What the run's randomness grew from.
    pub seed: u64,
    /// Whether the robot behaved socially.
    pub social: bool,
    /// Which ways its base goes: `differential` or `omnidirectional`.
    pub base: &'static str,
    /// Whether every mission succeeded.
    pub success: bool,
    /// Whether the time was up before a mission had ended.
    pub timed_out: bool,
    /// The shortest way from where the robot began to where it ended, with nobody there, m.
    pub shortest_path: Option<f64>,
    /// Success weighted by path length, in [0, 1]; see [`crate::metrics::spl`].
    pub spl: Option<f64>,
    /// The missions; `None` where there were none.
    pub mission: Option<MissionReport>,
    /// `robot`, `motion`, `company`, `people`, `psi` and `psi_moving` of the run.
    #[serde(flatten)]
    pub metrics: Metrics,
    /// The steps that were taken up, of all plans, in order.
    pub plan: Vec<StepReport>,
    /// How often a plan was given up for another one.
    pub replans: u64,
    /// The processes, in the order in which they were started first.
    pub agents: Vec<AgentReport>,
    /// The same without social behaviour, where that was run too.
    pub baseline: Option<Baseline>,
}

/// All missions of a run. Its own fields are those of the one that decided: the first that did not
/// succeed, else the last.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MissionReport {
    #[serde(flatten)]
    decisive: MissionOutcome,
    missions: Vec<MissionOutcome>,
}

/// What became of one mission.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MissionOutcome {
    /// Its name.
    pub name: String,
    /// Its goal, AGGL.
    pub goal: String,
    /// `queued`, `running`, `succeeded` or `failed`, as in the graph.
    pub status: String,
    /// Why, where the executive said so.
    pub reason: Option<String>,
}

/// One step of a plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StepReport {
    /// The mission that it is for.
    pub mission: String,
    /// The rule to apply.
    pub rule: String,
    /// Names of nodes for the rule's variables.
    pub binding: BTreeMap<String, String>,
    /// `pending`, `dispatched`, `running`, `done` or `failed`, as in the graph.
    pub status: String,
}

/// One process.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AgentReport {
    /// The agent.
    pub name: String,
    /// How often it died and was started again.
    pub restarts: u64,
    /// Computing time of all its lives; `None` in lockstep, where a report holds only what follows
    /// from the seed.
    pub cpu_seconds: Option<f64>,
}

/// The same missions without social behaviour.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Baseline {
    /// Whether every mission succeeded.
    pub success: bool,
    /// Success weighted by path length.
    pub spl: Option<f64>,
    /// `robot`, `motion`, `company`, `people`, `psi` and `psi_moving` of that run.
    #[serde(flatten)]
    pub metrics: Metrics,
}

impl MissionOutcome {
    /// Whether its goal was reached.
    pub fn succeeded(&self) -> bool {
        self.status == "succeeded"
    }
}

impl MissionReport {
    /// The report of these missions, in the order in which they were tackled; `None` of none.
    pub fn of(missions: Vec<MissionOutcome>) -> Option<Self> {
        let failed = missions.iter().find(|mission| !mission.succeeded());
        let decisive = failed.or(missions.last())?.clone();
        Some(Self { decisive, missions })
    }

    /// The mission that decided: the first that did not succeed, else the last.
    pub fn decisive(&self) -> &MissionOutcome {
        &self.decisive
    }

    /// All missions.
    pub fn missions(&self) -> &[MissionOutcome] {
        &self.missions
    }

    /// Whether one was still to be ended when the run was over.
    pub fn timed_out(&self) -> bool {
        let open = |mission: &MissionOutcome| matches!(&*mission.status, "queued" | "running");
        self.missions.iter().any(open)
    }

    /// Whether all of them succeeded.
    pub fn succeeded(&self) -> bool {
        self.missions.iter().all(MissionOutcome::succeeded)
    }
}

impl Report {
    /// The text of `report.json`. Equal reports have equal text, to the byte.
    ///
    /// # Errors
    /// None is known: all keys are strings, and numbers that JSON lacks are written as null.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        let mut text = serde_json::to_string_pretty(self)?;
        text.push('\n');
        Ok(text)
    }

    /// The figures as a table for a person, beside those without social behaviour where known.
    pub fn table(&self) -> String {
        table::of(self)
    }
}
