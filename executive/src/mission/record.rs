//! Missions and steps as the graph has them: read as plain records, written as the difference of
//! two. This file guarantees that what did not change is not written, and that a change is refused
//! by the store where somebody else changed the same node since it was read.

use super::decision::{self, Decision, Occasion};
use super::schedule::Schedule;
use dsr::{
    Node, NodeId, NodeRef, Operation, Owner, Precondition, ReadError, Snapshot, Time, Transaction,
    Value, Version,
};
use grammar::Binding;
use std::collections::BTreeMap;
use std::fmt;

/// How a mission stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MissionStatus {
    /// It waits for others of higher priority.
    Queued,
    /// It is being carried out, or a plan is sought for it.
    Running,
    /// Somebody asked for it to wait.
    Paused,
    /// Its goal held.
    Succeeded,
    /// It was given up; `reason` says why.
    Failed,
    /// Somebody asked for its end.
    Cancelled,
}

impl MissionStatus {
    const ALL: [Self; 6] = [
        Self::Queued,
        Self::Running,
        Self::Paused,
        Self::Succeeded,
        Self::Failed,
        Self::Cancelled,
    ];

    /// As it stands in the graph.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Paused => "paused",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// Whether the mission is over.
    pub const fn is_over(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

/// When a mission gives way to one of higher priority.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Preemption {
    /// Even in the middle of a step.
    #[default]
    AtOnce,
    /// When no step of it is in an agent's hands.
    BetweenSteps,
    /// Not before it is over.
    Never,
}

impl Preemption {
    /// Each of them.
    pub const ALL: [Self; 3] = [Self::AtOnce, Self::BetweenSteps, Self::Never];

    /// As it stands in the graph.
    pub const fn name(self) -> &'static str {
        match self {
            Self::AtOnce => "at_once",
            Self::BetweenSteps => "between_steps",
            Self::Never => "never",
        }
    }
}

/// What somebody asks of a mission, by its attribute `request`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// Let it wait; its step in hand is dropped.
    Pause,
    /// Let it go on.
    Resume,
    /// End it.
    Cancel,
}

impl Request {
    const ALL: [Self; 3] = [Self::Pause, Self::Resume, Self::Cancel];

    /// As it stands in the graph.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pause => "pause",
            Self::Resume => "resume",
            Self::Cancel => "cancel",
        }
    }

    /// The request of that name.
    pub fn find(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|request| request.name() == name)
    }
}

/// How a step stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepStatus {
    /// Others come first.
    Pending,
    /// Its agent shall carry it out.
    Dispatched,
    /// Its agent carries it out.
    Running,
    /// It was carried out, or its effect holds.
    Done,
    /// Its agent could not do it, or took too long.
    Failed,
    /// Its agent did not take it in time.
    Unanswered,
    /// Its plan was abandoned before it was over.
    Dropped,
}

impl StepStatus {
    const ALL: [Self; 7] = [
        Self::Pending,
        Self::Dispatched,
        Self::Running,
        Self::Done,
        Self::Failed,
        Self::Unanswered,
        Self::Dropped,
    ];

    /// As it stands in the graph.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pending => "pending",
            Self::Dispatched => "dispatched",
            Self::Running => "running",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Unanswered => "unanswered",
            Self::Dropped => "dropped",
        }
    }

    /// Whether the step is still to be done.
    pub const fn is_open(self) -> bool {
        matches!(self, Self::Pending | Self::Dispatched | Self::Running)
    }

    /// Whether its agent did not bring it about.
    pub const fn is_failure(self) -> bool {
        matches!(self, Self::Failed | Self::Unanswered)
    }

    /// Whether an agent has it in hand.
    pub const fn is_under_way(self) -> bool {
        matches!(self, Self::Dispatched | Self::Running)
    }
}

/// A `mission` node with its steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Mission {
    /// Its node.
    pub id: NodeId,
    /// The name of its node.
    pub name: String,
    /// What shall hold, in AGGL.
    pub goal: String,
    /// How it stands.
    pub status: MissionStatus,
    /// The larger, the sooner.
    pub priority: i64,
    /// It fails where its goal does not hold by then.
    pub deadline: Option<Time>,
    /// When it gives way to one of higher priority.
    pub preemption: Preemption,
    /// When it begins.
    pub schedule: Schedule,
    /// What somebody asks of it and the executive has not done yet, as written.
    pub request: String,
    /// How many plans followed the first one.
    pub replans: u64,
    /// Why it stands as it does; empty where that is plain.
    pub reason: String,
    /// What was decided about it, as the graph has it; see [`Self::decisions`].
    pub(crate) decided: String,
    /// By ascending index.
    pub steps: Vec<Step>,
}

impl Mission {
    /// What was decided about it lately, oldest first.
    pub fn decisions(&self) -> Vec<Decision> {
        decision::parse(&self.decided)
    }

    /// Adds a decision.
    pub(super) fn note(&mut self, now: Time, what: impl Into<String>, occasion: &Occasion) {
        decision::note(&mut self.decided, now, what.into(), occasion);
    }
}

/// A `step` node.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// `None` until it is in the graph.
    pub id: Option<NodeId>,
    /// The name of its node: mission, plan and index, between slashes.
    pub name: String,
    /// Counts through all plans of a mission: the steps of the plan in force are the open ones.
    pub index: u64,
    /// What is applied.
    pub rule: String,
    /// Who carries it out.
    pub agent: String,
    /// Variable to node name.
    pub binding: BTreeMap<String, String>,
    /// How it stands.
    pub status: StepStatus,
    /// When the status was written.
    pub since: Time,
    /// Why it stands as it does; empty where that is plain.
    pub reason: String,
}

/// A rule at a binding of variables to names of nodes.
pub(super) struct Applied<'a>(pub(super) &'a str, pub(super) &'a BTreeMap<String, String>);

impl fmt::Display for Applied<'_> {
    /// `changeRoom(robot=shelly, room1=hall, room2=kitchen)`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}(", self.0)?;
        for (index, (variable, node)) in self.1.iter().enumerate() {
            let comma = if index == 0 { "" } else { ", " };
            write!(f, "{comma}{variable}={node}")?;
        }
        f.write_str(")")
    }
}

impl fmt::Display for Step {
    /// As [`Cause::rules`](super::Cause::rules) has it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Applied(&self.rule, &self.binding).fmt(f)
    }
}

impl Step {
    /// The nodes that it is bound to, and the variables whose node is not in the graph.
    pub(crate) fn nodes(&self, snapshot: &Snapshot) -> Result<(Binding, Vec<&str>), ReadError> {
        let (mut found, mut missing) = (Binding::new(), Vec::new());
        for (variable, name) in &self.binding {
            match snapshot.find_node_by_name(name)? {
                Some(node) => found.insert(variable.as_str(), node.id()),
                None => missing.push(variable.as_str()),
            }
        }
        Ok((found, missing))
    }

    /// Whether it is the same rule at the same nodes.
    pub(crate) fn is_alike(&self, other: &Self) -> bool {
        self.rule == other.rule && self.binding == other.binding
    }

    /// Gives it another status, and says why.
    pub(crate) fn become_status(&mut self, status: StepStatus, why: &str, now: Time) {
        self.status = status;
        self.since = now;
        why.clone_into(&mut self.reason);
    }
}

fn text(node: &Node, name: &str) -> Result<String, ReadError> {
    let value = node.value(name)?;
    Ok(value
        .and_then(|value| value.as_str().map(str::to_owned))
        .unwrap_or_default())
}

fn seconds(node: &Node, name: &str) -> Result<Option<f64>, ReadError> {
    let value = node.value(name)?.and_then(|value| value.as_f64());
    Ok(value.filter(|seconds| seconds.is_finite()))
}

fn count(node: &Node, name: &str) -> Result<u64, ReadError> {
    Ok(node
        .value(name)?
        .and_then(|value| value.as_f64())
        .map_or(0, |value| value as u64))
}

/// All missions, without their steps, by ascending id. A status that nobody knows counts as queued,
/// a preemption that nobody knows as the default.
///
/// # Errors
/// [`ReadError`].
pub fn missions(snapshot: &Snapshot) -> Result<Vec<Mission>, ReadError> {
    let mut missions = Vec::new();
    for node in snapshot.nodes_of("mission") {
        let node = node?;
        let status = text(&node, "status")?;
        let known = MissionStatus::ALL
            .into_iter()
            .find(|known| known.name() == status);
        let priority = match node.value("priority")? {
            Some(Value::I64(priority)) => priority,
            _ => 0,
        };
        let preemption = text(&node, "preemption")?;
        let preemption = Preemption::ALL
            .into_iter()
            .find(|known| known.name() == preemption);
        missions.push(Mission {
            id: node.id(),
            name: node.name()?,
            goal: text(&node, "goal")?,
            status: known.unwrap_or(MissionStatus::Queued),
            priority,
            deadline: seconds(&node, "deadline")?.map(Time::from_seconds),
            preemption: preemption.unwrap_or_default(),
            schedule: Schedule {
                begins: seconds(&node, "begins")?.map(Time::from_seconds),
                period: seconds(&node, "period")?,
                after: Some(text(&node, "after")?).filter(|name| !name.is_empty()),
            },
            request: text(&node, "request")?,
            replans: count(&node, "replans")?,
            reason: text(&node, "reason")?,
            decided: text(&node, "decisions")?,
            steps: Vec::new(),
        });
    }
    missions.sort_by_key(|mission| mission.id);
    Ok(missions)
}

/// All missions with their steps, by ascending id.
///
/// # Errors
/// [`ReadError`].
pub fn missions_with_steps(snapshot: &Snapshot) -> Result<Vec<Mission>, ReadError> {
    let mut missions = missions(snapshot)?;
    for mission in &mut missions {
        mission.steps = steps(snapshot, mission.id)?;
    }
    Ok(missions)
}

/// The steps of a mission, by ascending index. A status that nobody knows counts as dropped, a
/// binding that cannot be read as empty.
///
/// # Errors
/// [`ReadError`].
pub fn steps(snapshot: &Snapshot, mission: NodeId) -> Result<Vec<Step>, ReadError> {
    let (Some(label), Some(status_id), Some(node)) = (
        snapshot.schema().find_label("has_step"),
        snapshot.schema().find_attribute("status"),
        snapshot.find_node(mission)?,
    ) else {
        return Ok(Vec::new());
    };
    let mut steps = Vec::new();
    for edge in node.out_edges_of(label) {
        let Some(node) = snapshot.find_node(edge?.to)? else {
            continue;
        };
        let status = node.attribute(status_id)?;
        let since = status
            .as_ref()
            .map_or_else(Time::default, |status| status.time);
        let status = status.as_ref().and_then(|status| status.value.as_str());
        let known = StepStatus::ALL
            .into_iter()
            .find(|known| status == Some(known.name()));
        steps.push(Step {
            id: Some(node.id()),
            name: node.name()?,
            index: count(&node, "index")?,
            rule: text(&node, "rule")?,
            agent: text(&node, "agent")?,
            binding: serde_json::from_str(&text(&node, "binding")?).unwrap_or_default(),
            status: known.unwrap_or(StepStatus::Dropped),
            since,
            reason: text(&node, "reason")?,
        });
    }
    steps.sort_by_key(|step| (step.index, step.id));
    Ok(steps)
}

/// What makes `before`, which was read from version `seen`, into `after`; `None` where they are
/// the same.
pub(crate) fn difference(before: &Mission, after: &Mission, seen: Version) -> Option<Transaction> {
    let mut transaction = Transaction::new();
    let mut guarded = vec![before.id];
    let mission = NodeRef::Id(before.id);
    if before.status != after.status {
        transaction.set(mission.clone(), "status", after.status.name());
    }
    if before.reason != after.reason {
        transaction.set(mission.clone(), "reason", after.reason.as_str());
    }
    if before.request != after.request {
        transaction.set(mission.clone(), "request", after.request.as_str());
    }
    let times = [
        ("begins", before.schedule.begins, after.schedule.begins),
        ("deadline", before.deadline, after.deadline),
    ];
    for (name, old, new) in times {
        if let Some(new) = new.filter(|_| new != old) {
            transaction.set(mission.clone(), name, new.seconds());
        }
    }
    if before.decided != after.decided {
        transaction.set(mission.clone(), "decisions", after.decided.as_str());
    }
    if before.replans != after.replans {
        transaction.set(mission.clone(), "replans", Value::U64(after.replans));
    }
    for step in &after.steps {
        let known = before.steps.iter().find(|known| known.name == step.name);
        let mut attributes = step.attributes();
        let Some((known, id)) = known.and_then(|known| Some((known, known.id?))) else {
            transaction.create_node("step", &step.name, attributes);
            transaction.create_edge(mission.clone(), "has_step", step.name.as_str());
            continue;
        };
        let old = known.attributes();
        attributes.retain(|attribute| !old.contains(attribute));
        if !attributes.is_empty() {
            guarded.push(id);
        }
        let owner = Owner::Node(NodeRef::Id(id));
        for (name, value) in attributes {
            transaction.push(Operation::SetAttribute {
                owner: owner.clone(),
                name,
                value,
            });
        }
    }
    for gone in &before.steps {
        if let Some(id) = gone.id
            && !after.steps.iter().any(|step| step.name == gone.name)
        {
            transaction.delete_node(id);
        }
    }
    for id in guarded {
        let node = NodeRef::Id(id);
        transaction = transaction.require(Precondition::NodeUnchangedSince {
            node,
            version: seen,
        });
    }
    (!transaction.is_empty()).then_some(transaction)
}

impl Step {
    fn attributes(&self) -> Vec<(String, Value)> {
        let binding = serde_json::to_string(&self.binding).unwrap_or_default();
        vec![
            ("rule".to_owned(), self.rule.as_str().into()),
            ("agent".to_owned(), self.agent.as_str().into()),
            ("binding".to_owned(), binding.into()),
            ("index".to_owned(), Value::U64(self.index)),
            ("status".to_owned(), self.status.name().into()),
            ("reason".to_owned(), self.reason.as_str().into()),
        ]
    }
}
