//! Missions and steps as the graph has them: read as plain records, written as the difference of
//! two. This file guarantees that what did not change is not written, and that a change is refused
//! by the store where somebody else changed the same node since it was read.

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
    /// Its goal held.
    Succeeded,
    /// It was given up; `reason` says why.
    Failed,
}

impl MissionStatus {
    const ALL: [Self; 4] = [Self::Queued, Self::Running, Self::Succeeded, Self::Failed];

    /// As it stands in the graph.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
        }
    }

    /// Whether the mission is over.
    pub const fn is_over(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed)
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
    /// Its plan was abandoned before it was over.
    Dropped,
}

impl StepStatus {
    const ALL: [Self; 6] = [
        Self::Pending,
        Self::Dispatched,
        Self::Running,
        Self::Done,
        Self::Failed,
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
            Self::Dropped => "dropped",
        }
    }

    /// Whether the step is still to be done.
    pub const fn is_open(self) -> bool {
        matches!(self, Self::Pending | Self::Dispatched | Self::Running)
    }

    /// Whether an agent has it in hand.
    pub const fn is_under_way(self) -> bool {
        matches!(self, Self::Dispatched | Self::Running)
    }
}

/// A `mission` node with its steps.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Mission {
    pub(crate) id: NodeId,
    pub(crate) name: String,
    pub(crate) goal: String,
    pub(crate) status: MissionStatus,
    pub(crate) priority: i64,
    pub(crate) replans: u64,
    pub(crate) reason: String,
    /// By ascending index.
    pub(crate) steps: Vec<Step>,
}

/// A `step` node.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Step {
    /// `None` until it is in the graph.
    pub(crate) id: Option<NodeId>,
    pub(crate) name: String,
    /// Counts through all plans of a mission: the steps of the plan in force are the open ones.
    pub(crate) index: u64,
    pub(crate) rule: String,
    pub(crate) agent: String,
    /// Variable to node name.
    pub(crate) binding: BTreeMap<String, String>,
    pub(crate) status: StepStatus,
    /// When the status was written.
    pub(crate) since: Time,
    pub(crate) reason: String,
}

impl fmt::Display for Step {
    /// `changeRoom(robot=shelly, room1=hall, room2=kitchen)`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}(", self.rule)?;
        for (index, (variable, node)) in self.binding.iter().enumerate() {
            let comma = if index == 0 { "" } else { ", " };
            write!(f, "{comma}{variable}={node}")?;
        }
        f.write_str(")")
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

fn count(node: &Node, name: &str) -> Result<u64, ReadError> {
    Ok(node
        .value(name)?
        .and_then(|value| value.as_f64())
        .map_or(0, |value| value as u64))
}

/// All missions, without their steps, by ascending id.
pub(crate) fn missions(snapshot: &Snapshot) -> Result<Vec<Mission>, ReadError> {
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
        missions.push(Mission {
            id: node.id(),
            name: node.name()?,
            goal: text(&node, "goal")?,
            status: known.unwrap_or(MissionStatus::Queued),
            priority,
            replans: count(&node, "replans")?,
            reason: text(&node, "reason")?,
            steps: Vec::new(),
        });
    }
    missions.sort_by_key(|mission| mission.id);
    Ok(missions)
}

/// The steps of a mission, by ascending index. A status that nobody knows counts as dropped, a
/// binding that cannot be read as empty.
pub(crate) fn steps(snapshot: &Snapshot, mission: NodeId) -> Result<Vec<Step>, ReadError> {
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
