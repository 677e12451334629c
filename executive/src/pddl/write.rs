//! PDDL text for what a grammar, a world and a goal ask of the planner, so that another planner can
//! check ours. This file guarantees that the text has a plan of a cost exactly where the planner's
//! own task has.
//!
//! The rules are written at the bindings that grounding found: an action a binding, without
//! parameters, over predicates of the world's own names. So everything that rules can say comes
//! through (values, new nodes, rules that wake others) without axioms, which admissible heuristics
//! of other planners do not take.

use crate::ground::{Atom, Ground, Place, Problem, ProblemError, Reached, Scope, build};
use crate::plan::{Options, Outcome};
use crate::search::{Limits, StopReason};
use crate::task::{Action, Fact, Formula, Literal, Micro, State, Task, holds};
use dsr::{ReadError, Snapshot, Value};
use grammar::{Goal, Grammar};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use thiserror::Error;

/// A domain and a problem in PDDL.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// The text of the domain.
    pub domain: String,
    /// The text of the problem.
    pub problem: String,
    /// So many units of total cost are one unit of the rules' costs: PDDL costs are whole numbers.
    pub scale: f64,
    /// What the text does not say.
    pub notes: Vec<String>,
    task: Task,
    actions: Actions,
    /// Actions that stand for the ways in which the goal may hold, where there are several.
    ends: Vec<(String, Formula)>,
}

/// Names of actions and their numbers in the task, by rule and arguments.
type Actions = BTreeMap<(String, Vec<String>), Vec<(String, usize)>>;

/// Why there is no text.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum WriteError {
    /// The snapshot cannot be read any more.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The goal names what is not there.
    #[error("{0}")]
    Goal(String),
    /// A limit was met.
    #[error("stopped while grounding: {0}")]
    Stopped(StopReason),
}

impl Written {
    /// The actions that a plan's steps are, and the one that ends it where the goal may hold in several ways.
    pub(super) fn plan(&self, outcome: &Outcome) -> Option<Vec<&str>> {
        let (mut state, mut next) = (self.task.initial().to_vec(), State::new());
        let mut names = Vec::new();
        for step in &outcome.steps {
            let key = (step.rule.clone(), step.arguments.clone());
            // Several where the cost depends on values that rules assign.
            let mut same = self.actions.get(&key)?.iter();
            let (name, action) =
                same.find(|(_, action)| self.task.is_applicable(&state, *action))?;
            self.task.successor(&state, *action, &mut next);
            std::mem::swap(&mut state, &mut next);
            names.push(name.as_str());
        }
        let mut ends = self.ends.iter();
        let end = ends.find(|(_, goal)| goal.holds(&state));
        names.extend(end.map(|(name, _)| name.as_str()));
        Some(names)
    }
}

/// Names as PDDL takes them, each used once.
#[derive(Default)]
struct Namer {
    known: BTreeMap<String, String>,
    used: BTreeSet<String>,
}

impl Namer {
    /// The name for a key; `wish` is what it shall look like.
    fn name(&mut self, key: &str, wish: &str) -> String {
        if let Some(known) = self.known.get(key) {
            return known.clone();
        }
        let mut base: String = wish
            .to_lowercase()
            .chars()
            .map(|c| {
                if c.is_ascii_alphanumeric() || c == '-' {
                    c
                } else {
                    '_'
                }
            })
            .collect();
        if !base.starts_with(|c: char| c.is_ascii_lowercase()) {
            base.insert(0, 'n');
        }
        let mut name = base.clone();
        let mut count = 1;
        while !self.used.insert(name.clone()) {
            count += 1;
            name = format!("{base}_{count}");
        }
        self.known.insert(key.to_owned(), name.clone());
        name
    }
}

/// Words that mean something to PDDL.
const RESERVED: [&str; 15] = [
    "and",
    "or",
    "not",
    "imply",
    "exists",
    "forall",
    "when",
    "increase",
    "total-cost",
    "object",
    "either",
    "define",
    "number",
    "reached",
    "stay",
];

struct Writer<'a> {
    problem: &'a Problem,
    reached: &'a Reached,
    ground: &'a Ground,
    objects: Namer,
    words: Namer,
    /// How many arguments each predicate has.
    predicates: BTreeMap<String, usize>,
    /// Objects that some fact names.
    constants: BTreeSet<String>,
    facts: Vec<String>,
}

/// Writes what `plan` would be asked.
///
/// # Errors
/// [`WriteError`].
pub fn write(
    grammar: &Grammar,
    snapshot: &Snapshot,
    goal: &Goal,
    options: &Options,
    limits: &mut Limits<'_>,
) -> Result<Written, WriteError> {
    let problem = Problem::read(grammar, snapshot, goal, options.spares).map_err(|e| match e {
        ProblemError::Read(error) => WriteError::Read(error),
        ProblemError::Goal(reason) => WriteError::Goal(reason),
    })?;
    let awake = problem.awake(&options.awake);
    let reached = problem
        .reach(&awake, Scope::All(usize::MAX), limits)
        .map_err(WriteError::Stopped)?;
    let initial = &problem.world.facts;
    let ground = build(
        &problem.program,
        &problem.goal,
        initial,
        &awake,
        &reached,
        &|_| 0.0,
        limits,
    )
    .map_err(WriteError::Stopped)?;
    let mut writer = Writer::new(&problem, &reached, &ground);
    let mut actions = Actions::new();
    let mut text = String::new();
    let scale = scale(ground.task.actions());
    for (index, action) in ground.task.actions().iter().enumerate() {
        let instance = &reached.instances[ground.actions[index]];
        let rule = problem.program.operators[instance.operator].name.clone();
        let arguments = problem.arguments(instance);
        let wish = format!("{rule} {}", arguments.join(" "));
        let name = writer
            .words
            .name(&format!("action {index}"), wish.trim_end());
        let mut effects = Vec::new();
        for effect in &action.effects {
            let mut changes: Vec<String> = Vec::new();
            let added = |fact: &Fact| effect.add.contains(fact);
            let deleted = effect.delete.iter().filter(|fact| !added(fact));
            changes.extend(deleted.map(|&f| format!("(not {})", writer.facts[f as usize])));
            changes.extend(effect.add.iter().map(|&f| writer.facts[f as usize].clone()));
            if effect.condition == Formula::TRUE {
                effects.extend(changes);
            } else {
                let condition = writer.formula(&effect.condition);
                effects.push(format!("(when {condition} (and {}))", changes.join(" ")));
            }
        }
        let cost = action.cost / (1_000_000 / scale);
        effects.push(format!("(increase (total-cost) {cost})"));
        let precondition = writer.conjunction(&action.precondition);
        push_action(&mut text, &name, &precondition, &effects);
        let same = actions.entry((rule, arguments)).or_default();
        same.push((name, index));
    }
    let goal = ground.task.goal();
    let mut ends = Vec::new();
    let mut wanted = writer.conjunction(goal);
    if !is_plain(goal) {
        "(and (reached))".clone_into(&mut wanted);
        let ways = match goal {
            Formula::Or(ways) => ways.clone(),
            other => vec![other.clone()],
        };
        for way in ways {
            let name = writer.words.name(&format!("end {}", ends.len()), "goal");
            let precondition = writer.conjunction(&way);
            push_action(&mut text, &name, &precondition, &["(reached)".to_owned()]);
            ends.push((name, way));
        }
    }
    // An empty goal makes some planners look for axioms.
    let there = *goal == Formula::TRUE;
    if there {
        "(and (reached))".clone_into(&mut wanted);
    }
    // Some readers want a predicate and an action, even where none is needed.
    if there || !is_plain(goal) || text.is_empty() || writer.predicates.is_empty() {
        writer.predicates.insert("reached".to_owned(), 0);
    }
    if text.is_empty() {
        let effects = ["(reached)", "(increase (total-cost) 0)"].map(str::to_owned);
        push_action(&mut text, "stay", "(and (reached))", &effects);
    }
    let notes = notes(&problem, &reached, &ground);
    Ok(Written {
        domain: writer.domain(&text, scale, &notes),
        problem: writer.problem(&wanted, there),
        scale: scale as f64,
        notes,
        task: ground.task.clone(),
        actions,
        ends,
    })
}

/// What the text does not say.
fn notes(problem: &Problem, reached: &Reached, ground: &Ground) -> Vec<String> {
    let mut notes = problem.program.notes.clone();
    notes.extend(ground.unpriced.iter().map(|rule| problem.unpriced(rule)));
    let mut actions = ground.task.actions().iter();
    if actions.any(|action| action.success < 1.0) {
        let note = "rules that may fail are written with their own costs alone: what a failure \
                    wastes depends on the steps before it, which PDDL cannot say";
        notes.push(note.to_owned());
    }
    if reached.truncated {
        notes.push("attributes were followed through their first values only".to_owned());
    }
    notes
}

/// The least power of ten that makes all costs whole.
fn scale(actions: &[Action]) -> Micro {
    let fits = |scale: &Micro| {
        actions
            .iter()
            .all(|action| action.cost % (1_000_000 / scale) == 0)
    };
    let scales = [1, 10, 100, 1000, 10_000, 100_000];
    scales.into_iter().find(fits).unwrap_or(1_000_000)
}

/// Whether a formula is a literal or several of them, of which all must hold.
fn is_plain(formula: &Formula) -> bool {
    match formula {
        Formula::Literal(_) => true,
        Formula::And(parts) => parts.iter().all(|p| matches!(p, Formula::Literal(_))),
        Formula::Or(_) => false,
    }
}

fn push_action(text: &mut String, name: &str, precondition: &str, effects: &[String]) {
    // Writing to a string does not fail.
    let _ = write!(
        text,
        "  (:action {name}\n    :parameters ()\n    :precondition {precondition}\n    \
         :effect (and {}))\n",
        effects.join(" ")
    );
}

impl<'a> Writer<'a> {
    fn new(problem: &'a Problem, reached: &'a Reached, ground: &'a Ground) -> Self {
        let mut writer = Self {
            problem,
            reached,
            ground,
            objects: Namer::default(),
            words: Namer::default(),
            predicates: BTreeMap::new(),
            constants: BTreeSet::new(),
            facts: Vec::new(),
        };
        writer.words.used.extend(RESERVED.map(str::to_owned));
        writer.objects.used.extend(RESERVED.map(str::to_owned));
        for &atom in &ground.atoms {
            let fact = writer.fact(atom);
            writer.facts.push(fact);
        }
        writer
    }

    fn fact(&mut self, atom: Atom) -> String {
        let vocabulary = &self.problem.program.vocabulary;
        let operators = &self.problem.program.operators;
        let (wish, objects) = match atom {
            Atom::Link(link) => {
                let label = vocabulary.labels.name(link.label);
                (label.to_owned(), vec![link.from, link.to])
            }
            Atom::Type(object, exact) => {
                (format!("is-{}", vocabulary.types.name(exact)), vec![object])
            }
            Atom::Used(operator, spare) => (
                format!("used-{}-{}", operators[operator].name, spare + 1),
                vec![],
            ),
            Atom::Awake(operator) => (format!("awake-{}", operators[operator].name), vec![]),
            Atom::Value(place, index) => {
                let value = match self.reached.facts.values(place).get(index) {
                    Some(Some(Value::String(text))) => text.clone(),
                    Some(Some(value)) => format!("{value:?}"),
                    _ => "none".to_owned(),
                };
                let number = value
                    .split_once('(')
                    .map(|(_, rest)| rest.trim_end_matches(')'));
                let value = number.unwrap_or(&value);
                let attribute = vocabulary.attributes.name(place.attribute());
                match place {
                    Place::Node(object, _) => (format!("{attribute}-{value}"), vec![object]),
                    Place::Link(link, _) => {
                        let label = vocabulary.labels.name(link.label);
                        (
                            format!("{label}-{attribute}-{value}"),
                            vec![link.from, link.to],
                        )
                    }
                }
            }
        };
        // Links and types of one name share a predicate; values do where they read the same.
        let key = match atom {
            Atom::Link(link) => format!("link {}", link.label),
            Atom::Type(_, exact) => format!("type {exact}"),
            Atom::Value(place, index) => format!(
                "value {wish} {:?}",
                self.reached.facts.values(place).get(index)
            ),
            other => format!("{other:?}"),
        };
        let predicate = self.words.name(&key, &wish);
        self.predicates.insert(predicate.clone(), objects.len());
        let mut text = format!("({predicate}");
        for object in objects {
            let name = self.problem.name(object);
            let name = self.objects.name(&format!("{object}"), name);
            text.push(' ');
            text.push_str(&name);
            self.constants.insert(name);
        }
        text + ")"
    }

    fn literal(&self, literal: Literal) -> String {
        let fact = &self.facts[literal.fact() as usize];
        if literal.negated() {
            format!("(not {fact})")
        } else {
            fact.clone()
        }
    }

    fn formula(&self, formula: &Formula) -> String {
        let all = |word: &str, parts: &[Formula]| {
            let parts: Vec<String> = parts.iter().map(|part| self.formula(part)).collect();
            format!("({word} {})", parts.join(" "))
        };
        match formula {
            Formula::Literal(literal) => self.literal(*literal),
            Formula::And(parts) => all("and", parts),
            Formula::Or(parts) => all("or", parts),
        }
    }

    fn conjunction(&self, formula: &Formula) -> String {
        match formula {
            Formula::And(_) => self.formula(formula),
            other => format!("(and {})", self.formula(other)),
        }
    }

    fn domain(&self, actions: &str, scale: Micro, notes: &[String]) -> String {
        let mut text = String::new();
        for note in notes {
            let _ = writeln!(text, "; {note}");
        }
        if scale > 1 {
            let _ = writeln!(
                text,
                "; a total cost of {scale} is a cost of 1 by the rules"
            );
        }
        text.push_str("(define (domain rules)\n  (:requirements :adl :action-costs)\n");
        if !self.constants.is_empty() {
            let names: Vec<&str> = self.constants.iter().map(String::as_str).collect();
            let _ = writeln!(text, "  (:constants {})", names.join(" "));
        }
        text.push_str("  (:predicates");
        for (name, arguments) in &self.predicates {
            let arguments = [" ?a", " ?b"][..*arguments].concat();
            let _ = write!(text, "\n    ({name}{arguments})");
        }
        text.push_str(")\n  (:functions (total-cost) - number)\n");
        text.push_str(actions);
        text + ")\n"
    }

    fn problem(&self, goal: &str, there: bool) -> String {
        let mut text = "(define (problem world)\n  (:domain rules)\n  (:init".to_owned();
        if there {
            text.push_str("\n    (reached)");
        }
        for (fact, name) in (0..).zip(&self.facts) {
            if holds(self.ground.task.initial(), fact) {
                let _ = write!(text, "\n    {name}");
            }
        }
        text.push_str("\n    (= (total-cost) 0))\n");
        let _ = write!(
            text,
            "  (:goal {goal})\n  (:metric minimize (total-cost)))\n"
        );
        text
    }
}
