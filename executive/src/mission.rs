//! The executive's pure core: takes missions in turn, has plans made, hands out their steps, and
//! plans anew where the world does not go along. It guarantees that all it goes by stands in the
//! graph: an executive that is started anew goes on where the last one was,
//! and a transaction that got lost or came twice does no harm.

mod adopt;
mod attend;
mod culprit;
mod decision;
mod failures;
mod outcomes;
mod pursue;
pub(crate) mod record;
mod schedule;
mod spec;
#[cfg(test)]
mod testing;

pub use decision::{Cause, Decision};
pub use outcomes::experience;
pub use record::{
    Mission, MissionStatus, Preemption, Request, Step as MissionStep, StepStatus, missions,
    missions_with_steps, steps,
};
pub use schedule::Schedule;
pub use spec::{Config, Entry, MissionSpec, Planner, RulePlanner};

use crate::monitor::{Interest, Monitor};
use decision::Occasion;
use dsr::{Change, NodeChange, ReadError, Schema, Snapshot, Time, Transaction, Version};
use grammar::live::Published;
use grammar::{Goal, Grammar};
use std::collections::BTreeMap;

/// What is remembered besides the graph, of the mission in hand only. Losing it costs a little
/// time and nothing else.
#[derive(Debug, Clone, Default)]
struct Search {
    mission: String,
    /// No plan before this.
    not_before: Option<Time>,
    /// Since when there has been no plan.
    fruitless: Option<Time>,
    /// What made a new plan necessary.
    why: Occasion,
    /// The version in which nothing was in the plan's way when last looked.
    sound: Option<Version>,
    /// What came in its way since.
    traced: Option<Occasion>,
    /// Whether the mission's reason tells of what is in the way ahead.
    warned: bool,
    /// Whether a plan ran out without the goal: no more of one is left out then.
    missed: bool,
}

/// The executive agent without its process.
#[derive(Debug)]
pub struct Executive<P> {
    grammar: Grammar,
    /// The version of the graph that brought the grammar, if it came from there.
    rules: Option<Version>,
    missions: Vec<MissionSpec>,
    planner: P,
    config: Config,
    monitor: Monitor,
    goals: BTreeMap<String, Result<Goal, String>>,
    search: Search,
    /// What the mission in hand hangs on.
    interest: Interest,
    journal: Vec<Entry>,
}

/// What a mission is looked at with, in one turn.
#[derive(Clone, Copy)]
struct Turn<'a> {
    now: Time,
    snapshot: &'a Snapshot,
    goal: &'a Goal,
    /// Whether planning shall end at once.
    interrupted: &'a dyn Fn() -> bool,
}

impl<P: Planner> Executive<P> {
    /// An executive that looks after `missions` and whatever other missions the graph has.
    pub fn new(grammar: Grammar, missions: Vec<MissionSpec>, planner: P) -> Self {
        Self::with_config(grammar, missions, planner, Config::default())
    }

    /// As [`Self::new`], with other settings.
    pub fn with_config(
        grammar: Grammar,
        missions: Vec<MissionSpec>,
        planner: P,
        config: Config,
    ) -> Self {
        Self {
            monitor: Monitor::new(&grammar),
            grammar,
            rules: None,
            missions,
            planner,
            config,
            goals: BTreeMap::new(),
            search: Search::default(),
            interest: Interest::default(),
            journal: Vec::new(),
        }
    }

    /// The decisions made since this was last called.
    pub fn take_journal(&mut self) -> Vec<Entry> {
        std::mem::take(&mut self.journal)
    }

    fn log(&mut self, now: Time, what: String, why: impl Into<String>) {
        self.journal.push(Entry {
            time: now,
            what,
            why: why.into(),
        });
    }

    /// Whether a commit can make the next turn decide anything. All that [`Self::step`] last looked
    /// at for the plan in force counts, and whatever happens to missions, steps and rules. `schema`
    /// is the graph's after the commit.
    pub fn concerns(&self, change: &Change, schema: &Schema) -> bool {
        let own = |node: &NodeChange| {
            let name = schema.type_name(node.type_id);
            ["mission", "step", grammar::live::NODE].contains(&name)
        };
        change.nodes.iter().any(own) || self.interest.touched_by(change, schema)
    }

    /// One turn: what is to be written, for the store to take in this order. An unchanged world
    /// gives nothing, except where time itself brings something about.
    ///
    /// # Errors
    /// [`ReadError`]: take a new snapshot; nothing was decided.
    pub fn step(&mut self, now: Time, snapshot: &Snapshot) -> Result<Vec<Transaction>, ReadError> {
        self.step_unless(now, snapshot, &|| false)
    }

    /// As [`Self::step`], but planning ends without a plan as soon as `interrupted` says so, which is
    /// asked every few states: the next turn plans again, if there is still something to plan.
    ///
    /// # Errors
    /// As for [`Self::step`].
    pub fn step_unless(
        &mut self,
        now: Time,
        snapshot: &Snapshot,
        interrupted: &dyn Fn() -> bool,
    ) -> Result<Vec<Transaction>, ReadError> {
        self.follow_rules(now, snapshot)?;
        let mut missions = record::missions(snapshot)?;
        let mut transactions = self.announce(now, snapshot, &missions)?;
        let attended = self.attend(now, snapshot, &mut missions)?;
        if !attended.is_empty() {
            // What is pursued next is decided when this is in the graph.
            transactions.extend(attended);
            return Ok(transactions);
        }
        let Some(mut before) = self.choose(now, &missions) else {
            return Ok(transactions);
        };
        before.steps = record::steps(snapshot, before.id)?;
        if self.search.mission != before.name {
            self.search = Search {
                mission: before.name.clone(),
                ..Search::default()
            };
        }
        let mut after = before.clone();
        self.pursue(now, snapshot, &mut after, interrupted)?;
        self.interest = self.interest(snapshot, &after)?;
        transactions.extend(record::difference(&before, &after, snapshot.version()));
        transactions.extend(self.wake(snapshot, &before, &after)?);
        Ok(transactions)
    }

    /// Goes by the rules that the graph has, as soon as they change.
    fn follow_rules(&mut self, now: Time, snapshot: &Snapshot) -> Result<(), ReadError> {
        let version = Published::version(snapshot)?;
        if version.is_none() || version == self.rules {
            return Ok(());
        }
        let Some(published) = Published::find(snapshot)? else {
            return Ok(());
        };
        let known = std::mem::replace(&mut self.rules, version);
        match published.read(snapshot.schema()) {
            Ok(grammar) if grammar == self.grammar => {}
            Ok(grammar) => {
                self.monitor = Monitor::new(&grammar);
                self.grammar = grammar;
                self.goals.clear();
                self.search = Search::default();
                if known.is_some() {
                    let why = format!("version {} of the graph brought them", published.version);
                    self.log(now, "the rules have changed".to_owned(), why);
                }
            }
            // The store does not let such rules in; were they there, the old ones are better.
            Err(defects) => self.log(now, "the old rules stay".to_owned(), defects.to_string()),
        }
        Ok(())
    }

    /// Wakes the rules that steps which have just come to be done activate: the effect of a step
    /// may have been brought about by the world rather than by applying its rule.
    fn wake(
        &self,
        snapshot: &Snapshot,
        before: &Mission,
        after: &Mission,
    ) -> Result<Option<Transaction>, ReadError> {
        let was_open = |index| {
            let step = before.steps.iter().find(|step| step.index == index);
            step.is_some_and(|step| step.status.is_open())
        };
        let mut transaction = Transaction::new();
        for step in &after.steps {
            if step.status == StepStatus::Done
                && was_open(step.index)
                && let Some(rule) = self.grammar.rule(&step.rule)
            {
                transaction
                    .operations
                    .extend(self.grammar.waking(snapshot, rule)?);
            }
        }
        Ok((!transaction.operations.is_empty()).then_some(transaction))
    }

    /// Puts the missions into the graph that it does not have yet.
    fn announce(
        &mut self,
        now: Time,
        snapshot: &Snapshot,
        known: &[Mission],
    ) -> Result<Vec<Transaction>, ReadError> {
        let mut transactions = Vec::new();
        for mission in self.missions.clone() {
            if known.iter().any(|known| known.name == mission.name) {
                continue;
            }
            if snapshot.find_node_by_name(&mission.name)?.is_some() {
                let what = format!("mission `{}` is left out", mission.name);
                self.log(now, what, "the graph has another node of that name");
                self.missions.retain(|other| other.name != mission.name);
                continue;
            }
            let mut transaction = Transaction::new();
            transaction.create_node("mission", &mission.name, mission.attributes());
            transactions.push(transaction);
            self.log(now, format!("mission `{}` is queued", mission.name), "");
        }
        Ok(transactions)
    }

    /// The mission in hand, else the next one.
    fn choose(&self, now: Time, missions: &[Mission]) -> Option<Mission> {
        let ready = |mission: &&Mission| mission.is_ready(now, missions);
        let first = missions.iter().filter(ready).min_by_key(|mission| {
            let waits = mission.status != MissionStatus::Running;
            (waits, self.rank(mission))
        });
        first.cloned()
    }

    /// Missions that are ready are taken in this order: by priority, deadline, place in the list
    /// that the executive was given, and age.
    fn rank(&self, mission: &Mission) -> impl Ord + use<P> {
        let listed = self
            .missions
            .iter()
            .position(|spec| spec.name == mission.name);
        (
            std::cmp::Reverse(mission.priority),
            mission.deadline.is_none(),
            mission.deadline,
            listed.unwrap_or(usize::MAX),
            mission.id,
        )
    }

    fn goal(&mut self, text: &str) -> Result<Goal, String> {
        let types = &self.grammar.types;
        let read = || {
            grammar::parse_goal(text, "goal", types)
                .map_err(|defects| format!("the goal cannot be read: {defects}"))
        };
        self.goals
            .entry(text.to_owned())
            .or_insert_with(read)
            .clone()
    }

    /// Marks the first `over` open steps as done.
    fn tick_off(&mut self, now: Time, mission: &mut Mission, over: usize) {
        for step in mission
            .steps
            .iter_mut()
            .filter(|step| step.status.is_open())
            .take(over)
        {
            step.become_status(StepStatus::Done, "its effect holds", now);
            let what = format!("{step} is done");
            self.journal.push(Entry {
                time: now,
                what,
                why: step.reason.clone(),
            });
        }
    }

    fn dispatch(&mut self, now: Time, mission: &mut Mission, binding: BTreeMap<String, String>) {
        if let Some(step) = mission.steps.iter_mut().find(|step| step.status.is_open()) {
            step.binding = binding;
            step.become_status(StepStatus::Dispatched, "", now);
            let what = format!("{step} is dispatched to {}", step.agent);
            self.log(now, what, "");
        }
    }

    /// Ends a mission.
    fn finish(&mut self, now: Time, mission: &mut Mission, status: MissionStatus, why: &str) {
        drop_open(now, mission, why, None);
        mission.status = status;
        why.clone_into(&mut mission.reason);
        mission.note(now, status.name(), &Occasion::new(why));
        self.log(
            now,
            format!("mission `{}` {}", mission.name, status.name()),
            why,
        );
    }
}

/// Drops the steps still to be done, but for the one of index `keep`.
fn drop_open(now: Time, mission: &mut Mission, why: &str, keep: Option<u64>) {
    for step in mission
        .steps
        .iter_mut()
        .filter(|step| step.status.is_open())
    {
        if keep != Some(step.index) {
            step.become_status(StepStatus::Dropped, why, now);
        }
    }
}

#[cfg(test)]
mod tests;
