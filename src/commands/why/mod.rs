//! `cortex why`: what brought something about, from what the executive decided and what the graph keeps
//! of its commits. It guarantees that a rule or an agent that it names is the one that the graph has
//! on record; where the record is gone, it says so.

mod written;

use super::graph::{Path, Thing, attach, oldest_time};
use super::output::{clock, print, print_json};
use crate::cli::Why as Arguments;
use crate::{Answer, Failure};
use dsr::{ReadError, Snapshot, Time};
use executive::{Decision, Mission, MissionStep, Purpose};
use grammar::live::Published;
use grammar::{Goal, Grammar};
use serde_json::{Value, json};
use std::fmt::Write as _;
use written::Written;

/// What was found out, for people and for machines.
struct Told {
    text: String,
    json: Value,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Answer, Failure> {
    let mut session = attach(&arguments.instance.instance)?;
    let mut failure = None;
    let told = session.read(|snapshot| match tell(snapshot, arguments.what.as_deref()) {
        Ok(told) => Ok(Some(told)),
        Err(Untold::Read(error)) => Err(error),
        Err(Untold::Said(said)) => {
            failure = Some(said);
            Ok(None)
        }
    });
    let told: Option<Told> = told.map_err(Failure::internal)?;
    let Some(told) = told else {
        return Err(failure.unwrap_or_else(|| Failure::input("there is nothing to tell")));
    };
    if arguments.json {
        print_json(&told.json)?;
    } else {
        print(&told.text)?;
    }
    Ok(Answer::Yes)
}

/// What brought something about, as text for people and as the fields of the verb's JSON.
pub(crate) fn explain(snapshot: &Snapshot, what: Option<&str>) -> Result<Value, Failure> {
    match tell(snapshot, what) {
        Ok(told) => Ok(json!({"text": told.text, "told": told.json})),
        Err(Untold::Read(error)) => Err(Failure::internal(error)),
        Err(Untold::Said(failure)) => Err(failure),
    }
}

/// Why nothing is told.
enum Untold {
    /// The snapshot was overtaken, or is damaged.
    Read(ReadError),
    Said(Failure),
}

impl From<ReadError> for Untold {
    fn from(error: ReadError) -> Self {
        Self::Read(error)
    }
}

/// What the graph says of missions.
struct Known<'a> {
    snapshot: &'a Snapshot,
    missions: Vec<Mission>,
    grammar: Option<Grammar>,
}

fn tell(snapshot: &Snapshot, what: Option<&str>) -> Result<Told, Untold> {
    let published = Published::find(snapshot)?;
    let known = Known {
        missions: executive::missions_with_steps(snapshot)?,
        // The store lets in no other rules.
        grammar: published.and_then(|published| published.read(snapshot.schema()).ok()),
        snapshot,
    };
    let Some(what) = what else {
        return known.all();
    };
    if let Some(mission) = known.missions.iter().find(|mission| mission.name == what) {
        return known.mission(mission);
    }
    for mission in &known.missions {
        if let Some(step) = mission.steps.iter().find(|step| step.name == what) {
            return known.step(mission, step);
        }
    }
    let missing = |missing: Failure| {
        let kept = snapshot.time().since(oldest_time(snapshot));
        let help = format!(
            "what was removed more than {kept:.0} s ago, before version {}, is not kept; see `cortex graph history`",
            snapshot.oldest()
        );
        Untold::Said(missing.with_help(&help))
    };
    let (Path { thing, attribute }, gone) = Path::find_kept(snapshot, what).map_err(missing)?;
    match (gone, attribute) {
        (Some(last), _) => known.gone(thing, &last),
        (None, Some(attribute)) => known.attribute(thing, &attribute),
        (None, None) => known.thing(thing),
    }
}

/// What there is to say of a decision.
fn decision(decision: &Decision) -> String {
    let Decision {
        time,
        what,
        why,
        cause,
    } = decision;
    let mut line = format!("{}  {what}", clock(Time::from_seconds(*time)));
    if !why.is_empty() {
        let _ = write!(line, ": {why}");
    }
    if let Some(cause) = cause {
        let _ = write!(line, "; since version {} by {}", cause.version, cause.agent);
        if !cause.rules.is_empty() {
            let _ = write!(line, ", {}", cause.rules.join(", "));
        }
    }
    line
}

/// The decision that brought the step's plan, if it is still on record.
fn plan_of(mission: &Mission, step: &MissionStep) -> Option<Decision> {
    let number = step.name.rsplit('/').nth(1)?;
    let plan = format!("plan {number}");
    let mut decisions = mission.decisions().into_iter();
    decisions.find(|decision| decision.what == plan)
}

impl Known<'_> {
    fn all(&self) -> Result<Told, Untold> {
        let (mut texts, mut list) = (Vec::new(), Vec::new());
        for mission in &self.missions {
            let Told { text, json } = self.mission(mission)?;
            texts.push(text);
            list.push(json);
        }
        if texts.is_empty() {
            texts.push("there are no missions\n".to_owned());
        }
        Ok(Told {
            text: texts.join("\n"),
            json: json!(list),
        })
    }

    fn goal(&self, mission: &Mission) -> Option<Goal> {
        let types = &self.grammar.as_ref()?.types;
        grammar::parse_goal(&mission.goal, "goal", types).ok()
    }

    /// The goal's part that does not hold now, in words.
    fn lacks(&self, mission: &Mission) -> Option<String> {
        let (grammar, goal) = (self.grammar.as_ref()?, self.goal(mission)?);
        let obstacle = grammar.goal_obstacle(self.snapshot, &goal).ok().flatten();
        obstacle.map(|obstacle| obstacle.to_string())
    }

    fn mission(&self, mission: &Mission) -> Result<Told, Untold> {
        let status = mission.status.name();
        let mut text = format!("mission {} is {status}", mission.name);
        if !mission.reason.is_empty() {
            let _ = write!(text, ": {}", mission.reason);
        }
        text.push('\n');
        let waits = mission.waits_for(self.snapshot.time(), &self.missions, clock);
        for waits in &waits {
            let _ = writeln!(text, "  waits {waits}");
        }
        let decisions = mission.decisions();
        for one in &decisions {
            let _ = writeln!(text, "  {}", decision(one));
        }
        let lacks = (!mission.status.is_over())
            .then(|| self.lacks(mission))
            .flatten();
        if let Some(lacks) = &lacks {
            let _ = writeln!(text, "  the goal does not hold yet: {lacks}");
        }
        let open = mission.steps.iter().find(|step| step.status.is_open());
        let mut in_hand = Value::Null;
        if let Some(step) = open {
            let (status, agent) = (step.status.name(), &step.agent);
            let _ = writeln!(text, "  next: {} {step} by {agent}, {status}", step.name);
            let obstacle = self.obstacle(step)?;
            if let Some(obstacle) = &obstacle {
                let _ = writeln!(text, "  in its way: {obstacle}");
            }
            in_hand = json!({
                "step": step.name, "rule": step.rule, "binding": step.binding,
                "agent": step.agent, "status": status, "obstacle": obstacle,
            });
        }
        Ok(Told {
            text,
            json: json!({
                "kind": "mission", "mission": mission.name, "status": status,
                "reason": mission.reason, "goal": mission.goal, "lacks": lacks,
                "waits_for": waits, "decisions": decisions, "next": in_hand,
            }),
        })
    }

    fn obstacle(&self, step: &MissionStep) -> Result<Option<String>, ReadError> {
        match &self.grammar {
            Some(grammar) => executive::obstacle(grammar, self.snapshot, step),
            None => Ok(None),
        }
    }

    fn step(&self, mission: &Mission, step: &MissionStep) -> Result<Told, Untold> {
        let status = step.status.name();
        let mut text = format!(
            "step {} of mission {}: {step} by {} is {status}",
            step.name, mission.name, step.agent
        );
        if !step.reason.is_empty() {
            let _ = write!(text, ": {}", step.reason);
        }
        text.push('\n');
        let plan = plan_of(mission, step);
        if let Some(plan) = &plan {
            let _ = writeln!(text, "  {}", decision(plan));
        }
        let purposes = match &self.grammar {
            Some(grammar) => {
                let goal = self.goal(mission);
                executive::purposes(grammar, goal.as_ref(), &mission.steps, step)
            }
            None => Vec::new(),
        };
        let mut purpose_json = Vec::new();
        for Purpose { link, step } in &purposes {
            let whom = step.as_deref().unwrap_or("the goal");
            let _ = writeln!(text, "  makes {link} for {whom}");
            purpose_json.push(json!({ "link": link, "step": step }));
        }
        let mut written = |name: &str| -> Result<Option<Written>, ReadError> {
            let Some(id) = step.id else {
                return Ok(None);
            };
            let found = Written::of_attribute(self.snapshot, Thing::Node(id), name)?;
            if let Some((_, written)) = &found {
                let what = if name == "rule" { "planned" } else { status };
                let _ = writeln!(text, "  {what} {written}");
            }
            Ok(found.map(|(_, written)| written))
        };
        let planned = written("rule")?;
        let changed = written("status")?;
        let open = step.status.is_open();
        let obstacle = if open { self.obstacle(step)? } else { None };
        if let Some(obstacle) = &obstacle {
            let _ = writeln!(text, "  in its way: {obstacle}");
        }
        Ok(Told {
            text,
            json: json!({
                "kind": "step", "step": step.name, "mission": mission.name, "rule": step.rule,
                "binding": step.binding, "agent": step.agent, "status": status,
                "reason": step.reason, "plan": plan, "purpose": purpose_json,
                "planned": planned.map(|w| w.json()), "changed": changed.map(|w| w.json()),
                "obstacle": obstacle,
            }),
        })
    }
}
