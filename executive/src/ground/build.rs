//! From what may come to hold to a ground task. This file guarantees that facts that never change
//! are compiled away, that actions which cannot matter to the goal are left out, and that the task
//! has a plan of a cost exactly where the rules have.

mod conditions;

use super::effects::{Guard, Primitive, each_primitive};
use conditions::negation;

use super::choices::combinations;
use super::facts::Facts;
use super::program::{Link, Object, Operator, Place, Program};
use super::reach::{Instance, Reached};
use super::value::amount;
use crate::search::{Limits, StopReason};
use crate::task::{Action, Effect, Fact, Formula, Micro, Task, keep, micro, relevant};
use dsr::Value;
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeMap;

/// Something that holds or not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Atom {
    Link(Link),
    /// The object exists and is of that exact type.
    Type(Object, u16),
    /// The operator has used its spare of that number.
    Used(usize, usize),
    /// The operator is not dormant any more.
    Awake(usize),
    /// The place has the value of that number.
    Value(Place, usize),
}

/// A ground task and what its actions are.
#[derive(Debug)]
pub(crate) struct Ground {
    pub(crate) task: Task,
    /// The instance that each action is, by its number in [`Reached::instances`].
    pub(crate) actions: Vec<usize>,
    /// What each action costs without what was added to it.
    pub(crate) costs: Vec<Micro>,
    /// The facts of the task.
    pub(crate) atoms: Vec<Atom>,
    /// Rules that were left out where they cost nothing that can be reckoned with.
    pub(crate) unpriced: Vec<Unpriced>,
}

/// A rule that was left out at some bindings, where its cost has no value, or one that is no amount.
#[derive(Debug)]
pub(crate) struct Unpriced {
    pub(crate) operator: usize,
    /// The first of the bindings.
    pub(crate) objects: Vec<Object>,
    /// What its cost is there.
    pub(crate) value: Option<Value>,
    /// How many bindings.
    pub(crate) times: usize,
}

/// What an instance costs besides its rule's cost; infinity excludes it.
pub(crate) type Extra<'a> = dyn Fn(&Instance) -> f64 + 'a;

struct Builder<'a> {
    program: &'a Program,
    initial: &'a Facts,
    awake: &'a [bool],
    reached: &'a Reached,
    /// Spares that some instance uses.
    used: FxHashSet<(usize, usize)>,
    deleted: FxHashSet<Atom>,
    numbers: FxHashMap<Atom, Fact>,
    atoms: Vec<Atom>,
}

/// The changes of an action before facts have numbers: by condition, what is added and deleted.
type Changes = BTreeMap<Formula, (Vec<Atom>, Vec<Atom>)>;

/// Builds the task. `awake` tells which operators are not dormant at first.
///
/// # Errors
/// [`StopReason::Time`], [`StopReason::Memory`].
pub(crate) fn build(
    program: &Program,
    goal: &Operator,
    initial: &Facts,
    awake: &[bool],
    reached: &Reached,
    extra: &Extra<'_>,
    limits: &mut Limits<'_>,
) -> Result<Ground, StopReason> {
    let mut builder = Builder {
        program,
        initial,
        awake,
        reached,
        used: FxHashSet::default(),
        deleted: FxHashSet::default(),
        numbers: FxHashMap::default(),
        atoms: Vec::new(),
    };
    for instance in &reached.instances {
        builder.used.insert((instance.operator, instance.spare));
        builder.collect_deleted(instance);
    }
    let goals = reached.goals.iter();
    let wanted = goals.map(|environment| builder.demand(goal, &mut environment.clone()));
    let wanted: Vec<Formula> = wanted.collect();
    let wanted = Formula::any(wanted);
    let mut drafts: Vec<(usize, Formula, Changes, Micro, Micro)> = Vec::new();
    let mut unpriced: Vec<Unpriced> = Vec::new();
    let mut bytes = reached.bytes;
    for (index, instance) in reached.instances.iter().enumerate() {
        let operator = &program.operators[instance.operator];
        let more = extra(instance);
        let objects = &instance.objects;
        let (mut priced, mut left_out) = (Vec::new(), None);
        for (choice, value) in combinations(&operator.cost, objects, &reached.facts, program) {
            match amount(value.as_ref()) {
                Some(cost) => priced.push((choice, cost)),
                None => left_out = Some(value),
            }
        }
        if let Some(value) = left_out {
            let same = |known: &&mut Unpriced| {
                let alike = known.value.is_some() == value.is_some();
                known.operator == instance.operator && alike
            };
            match unpriced.iter_mut().find(same) {
                Some(known) => known.times += 1,
                None => unpriced.push(Unpriced {
                    operator: instance.operator,
                    objects: objects.clone(),
                    value,
                    times: 1,
                }),
            }
        }
        if more.is_infinite() || priced.is_empty() {
            continue;
        }
        let (precondition, changes) = builder.action(instance);
        // What the rule costs may depend on values that rules assign: an action for each choice of them.
        for (choice, cost) in priced {
            let precondition = match choice.as_slice() {
                [] => precondition.clone(),
                _ => Formula::all([precondition.clone(), builder.choice(&choice, true)]),
            };
            if precondition != Formula::FALSE {
                bytes += bytes_of(&precondition, &changes);
                let (cost, raised) = (micro(cost), micro(cost + more));
                drafts.push((index, precondition, changes.clone(), cost, raised));
            }
        }
        if index % 256 == 0 {
            limits.check(bytes)?;
        }
    }
    let mut actions = Vec::new();
    let (mut which, mut costs) = (Vec::new(), Vec::new());
    for (index, precondition, changes, cost, raised) in drafts {
        let effects = builder.effects(changes);
        if effects.is_empty() {
            continue;
        }
        let operator = &program.operators[reached.instances[index].operator];
        let mut action = Action::new(precondition, effects, raised);
        action.success = operator.success;
        actions.push(action);
        which.push(index);
        costs.push(cost);
    }
    let relevant = relevant(builder.atoms.len(), &wanted, &actions);
    let holding = |&fact: &Fact| builder.holds_at_first(builder.atoms[fact as usize]);
    let first: Vec<Fact> = (0..builder.atoms.len() as Fact).filter(holding).collect();
    limits.check(bytes)?;
    Ok(Ground {
        task: Task::new(
            builder.atoms.len(),
            &first,
            wanted,
            keep(actions, &relevant),
        ),
        actions: keep(which, &relevant),
        costs: keep(costs, &relevant),
        atoms: builder.atoms,
        unpriced,
    })
}

/// About what an action takes once it is one, with what searches keep of it.
fn bytes_of(precondition: &Formula, changes: &Changes) -> usize {
    let mut parts = 0;
    precondition.each_literal(&mut |_| parts += 1);
    for (condition, (come, gone)) in changes {
        condition.each_literal(&mut |_| parts += 1);
        parts += 2 + come.len() + gone.len();
    }
    400 + 100 * parts
}

impl<'a> Builder<'a> {
    /// The changes of an action on the facts that have numbers.
    fn effects(&self, changes: Changes) -> Vec<Effect> {
        let number = |atoms: Vec<Atom>| -> Vec<Fact> {
            let known = atoms.iter().filter_map(|atom| self.numbers.get(atom));
            let mut facts: Vec<Fact> = known.copied().collect();
            facts.sort_unstable();
            facts.dedup();
            facts
        };
        let mut effects: Vec<Effect> = Vec::new();
        for (condition, (add, delete)) in changes {
            let (add, delete) = (number(add), number(delete));
            if !(add.is_empty() && delete.is_empty()) {
                effects.push(Effect {
                    condition,
                    add,
                    delete,
                });
            }
        }
        effects
    }

    fn action(&mut self, instance: &Instance) -> (Formula, Changes) {
        let number = instance.operator;
        let program = self.program;
        let operator = &program.operators[number];
        let mut environment = instance.objects.clone();
        let mut needs = vec![self.demand(operator, &mut environment)];
        let mut changes = Changes::new();
        if operator.dormant {
            needs.push(self.literal(Atom::Awake(number), true));
        }
        for &woken in &operator.wakes {
            let always = changes.entry(Formula::TRUE).or_default();
            always.0.push(Atom::Awake(woken));
        }
        if operator.creates() {
            // Spares are interchangeable: they are used in their order.
            needs.push(self.literal(Atom::Used(number, instance.spare), false));
            if let Some(before) = instance.spare.checked_sub(1) {
                needs.push(self.literal(Atom::Used(number, before), true));
            }
            let always = changes.entry(Formula::TRUE).or_default();
            always.0.push(Atom::Used(number, instance.spare));
        }
        let mut primitives: Vec<(Formula, Primitive<'a>)> = Vec::new();
        let mut gone = Vec::new();
        let reached = self.reached;
        let mut visit = |guards: &[Guard<'a>], primitive: Primitive<'a>| {
            if let Primitive::Unlink(link) = primitive
                && !reached.facts.has_link(link)
            {
                return;
            }
            let parts: Vec<Formula> = guards
                .iter()
                .map(|guard| match guard {
                    Guard::Test(test, at) => self.test(test, &mut at.clone(), true),
                    Guard::OfType(object, types) => self.of_type(*object, types, true),
                })
                .collect();
            let condition = Formula::all(parts);
            if condition == Formula::FALSE {
                return;
            }
            if let Primitive::Delete(object) = primitive
                && condition == Formula::TRUE
            {
                gone.push(object);
            }
            primitives.push((condition, primitive));
        };
        each_primitive(
            &operator.changes,
            &reached.facts,
            &mut environment,
            &mut Vec::new(),
            &mut visit,
        );
        if operator.strict {
            needs.push(self.no_dangling(&primitives));
        }
        for (condition, primitive) in primitives {
            self.change(condition, primitive, &gone, &mut needs, &mut changes);
        }
        (Formula::all(needs), changes)
    }

    fn change(
        &mut self,
        condition: Formula,
        primitive: Primitive<'_>,
        gone: &[Object],
        needs: &mut Vec<Formula>,
        changes: &mut Changes,
    ) {
        let lasting = |link: Link| !gone.contains(&link.from) && !gone.contains(&link.to);
        let condition = self.needed_condition(condition, &primitive);
        match primitive {
            Primitive::Link(link) => {
                if lasting(link) {
                    let entry = changes.entry(condition).or_default();
                    entry.0.push(Atom::Link(link));
                }
            }
            Primitive::Unlink(link) => {
                let entry = changes.entry(condition).or_default();
                entry.1.push(Atom::Link(link));
            }
            Primitive::Create(object, exact) => {
                let entry = changes.entry(condition).or_default();
                entry.0.push(Atom::Type(object, exact));
            }
            Primitive::Retype(object, exact) => {
                if !gone.contains(&object) {
                    let others = self.types_of(object);
                    let entry = changes.entry(condition).or_default();
                    entry.0.push(Atom::Type(object, exact));
                    entry.1.extend(others);
                }
            }
            Primitive::Delete(object) => {
                let types = self.types_of(object);
                let links = self.reached.facts.links_at(object);
                let entry = changes.entry(condition).or_default();
                entry.1.extend(types);
                entry.1.extend(links.into_iter().map(Atom::Link));
            }
            Primitive::Assign(place, term, at) => {
                if !self.program.assigned[usize::from(place.attribute())] {
                    return;
                }
                for (choice, value) in combinations(term, &at, &self.reached.facts, self.program) {
                    let values = self.reached.facts.values(place);
                    let index = value
                        .and_then(|value| values.iter().position(|v| v.as_ref() == Some(&value)));
                    let others = 0..values.len();
                    if let Some(index) = index {
                        let chosen = self.choice(&choice, true);
                        let both = Formula::all([condition.clone(), chosen]);
                        if both == Formula::FALSE {
                            continue;
                        }
                        let entry = changes.entry(both).or_default();
                        entry.0.push(Atom::Value(place, index));
                        // Where the old value is part of the choice, it is the only one to go.
                        let before = choice.iter().find(|(known, _)| *known == place);
                        let others = others.filter(|&other| {
                            other != index && before.is_none_or(|&(_, old)| old == other)
                        });
                        entry
                            .1
                            .extend(others.map(|other| Atom::Value(place, other)));
                    } else {
                        // Without a value, the rule is refused.
                        let not_chosen = self.choice(&choice, false);
                        let not_guarded = negation(&condition);
                        needs.push(Formula::any([not_chosen, not_guarded]));
                    }
                }
            }
        }
    }

    /// That a link goes if it is there, or comes if it is not, needs no condition.
    fn needed_condition(&self, condition: Formula, primitive: &Primitive<'_>) -> Formula {
        let (link, there) = match primitive {
            Primitive::Link(link) => (link, false),
            Primitive::Unlink(link) => (link, true),
            _ => return condition,
        };
        match (&condition, self.numbers.get(&Atom::Link(*link))) {
            (Formula::Literal(literal), Some(&fact))
                if literal.fact() == fact && literal.negated() != there =>
            {
                Formula::TRUE
            }
            _ => condition,
        }
    }

    fn types_of(&self, object: Object) -> Vec<Atom> {
        let types = self.reached.facts.types(object).iter();
        types.map(|&exact| Atom::Type(object, exact)).collect()
    }

    /// That a strict rule leaves no link hanging.
    fn no_dangling(&mut self, primitives: &[(Formula, Primitive<'_>)]) -> Formula {
        let mut parts = Vec::new();
        for (condition, primitive) in primitives {
            let Primitive::Delete(object) = primitive else {
                continue;
            };
            for link in self.reached.facts.links_at(*object) {
                let unlinked = primitives
                    .iter()
                    .any(|(_, other)| matches!(other, Primitive::Unlink(l) if *l == link));
                if !unlinked {
                    let absent = self.literal(Atom::Link(link), false);
                    parts.push(Formula::any([absent, negation(condition)]));
                }
            }
        }
        Formula::all(parts)
    }

    /// Notes what an instance may delete.
    fn collect_deleted(&mut self, instance: &Instance) {
        let operator = &self.program.operators[instance.operator];
        let mut environment = instance.objects.clone();
        let facts = &self.reached.facts;
        let deleted = &mut self.deleted;
        let program = self.program;
        let mut visit = |_: &[Guard<'_>], primitive: Primitive<'_>| match primitive {
            Primitive::Link(_) | Primitive::Create(..) => {}
            Primitive::Unlink(link) => {
                deleted.insert(Atom::Link(link));
            }
            Primitive::Retype(object, _) => {
                let types = facts.types(object).iter();
                deleted.extend(types.map(|&exact| Atom::Type(object, exact)));
            }
            Primitive::Delete(object) => {
                let types = facts.types(object).iter();
                deleted.extend(types.map(|&exact| Atom::Type(object, exact)));
                deleted.extend(facts.links_at(object).into_iter().map(Atom::Link));
            }
            Primitive::Assign(place, ..) => {
                if program.assigned[usize::from(place.attribute())] {
                    let all = 0..facts.values(place).len();
                    deleted.extend(all.map(|value| Atom::Value(place, value)));
                }
            }
        };
        each_primitive(
            &operator.changes,
            facts,
            &mut environment,
            &mut Vec::new(),
            &mut visit,
        );
    }
}
