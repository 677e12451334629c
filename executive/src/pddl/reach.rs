//! Everything that actions may bring about, ignoring what they take away: actions are joined along
//! the atoms that they need, from each new atom on. This file guarantees that every plan uses only
//! instances and atoms found here.

use super::definition::{Action, Atom, Condition, Definition, Effect, Object, Term, Variables};
use super::facts::{AtomId, Facts};
use crate::search::{Limits, StopReason};
use rustc_hash::FxHashSet;
use std::collections::VecDeque;

/// A slot that is not bound.
const UNBOUND: Object = Object::MAX;

/// What may come to hold.
#[derive(Debug)]
pub(super) struct Reached {
    pub(super) facts: Facts,
    /// The first atoms are those that hold at first.
    pub(super) initial: usize,
    /// Actions with the objects of their parameters.
    pub(super) instances: Vec<(usize, Box<[Object]>)>,
}

/// What follows from some atoms.
enum Head {
    /// An instance of an action, and its unconditional effects.
    Action,
    /// Atoms that a conditional effect adds.
    Effects(Vec<Atom>),
}

/// Atoms from which something follows.
struct Rule<'a> {
    action: usize,
    body: Vec<Atom>,
    /// What its slots may stand for.
    domains: Vec<&'a [Object]>,
    /// Conditions of which it is looked whether they can hold at all.
    tests: Vec<&'a Condition>,
    head: Head,
}

/// The atoms that a condition needs whatever else it needs, and the rest of it. Variables of an
/// existential join in.
fn split<'a>(
    condition: &'a Condition,
    body: &mut Vec<Atom>,
    domains: &mut Vec<&'a [Object]>,
    tests: &mut Vec<&'a Condition>,
) {
    match condition {
        Condition::Atom(atom) => body.push(atom.clone()),
        Condition::All(parts) => parts.iter().for_each(|p| split(p, body, domains, tests)),
        // Its slots follow those in scope: they are free unless another existential took them.
        Condition::Exists(variables, inner) if variables.first == domains.len() => {
            domains.extend(variables.domains.iter().map(Vec::as_slice));
            split(inner, body, domains, tests);
        }
        other => tests.push(other),
    }
}

fn rules(number: usize, action: &Action) -> Vec<Rule<'_>> {
    fn walk<'a>(effects: &'a [Effect], outer: &Rule<'a>, rules: &mut Vec<Rule<'a>>) -> Vec<Atom> {
        let mut added = Vec::new();
        let mut inner = |variables: Option<&'a Variables>,
                         condition: Option<&'a Condition>,
                         effects: &'a [Effect]| {
            let mut rule = Rule {
                action: outer.action,
                body: outer.body.clone(),
                domains: outer.domains.clone(),
                tests: outer.tests.clone(),
                head: Head::Action,
            };
            if let Some(variables) = variables {
                // Slots that a condition's existential took are taken anew.
                if rule.domains.len() > variables.first {
                    let own =
                        |atom: &Atom| atom.arguments.iter().all(|t| within(*t, variables.first));
                    rule.body.retain(own);
                    rule.tests.clear();
                    rule.domains.truncate(variables.first);
                }
                rule.domains
                    .extend(variables.domains.iter().map(Vec::as_slice));
            }
            if let Some(condition) = condition {
                split(
                    condition,
                    &mut rule.body,
                    &mut rule.domains,
                    &mut rule.tests,
                );
            }
            let added = walk(effects, &rule, rules);
            rule.head = Head::Effects(added);
            rules.push(rule);
        };
        for effect in effects {
            match effect {
                Effect::Add(atom) => added.push(atom.clone()),
                Effect::Delete(_) => {}
                Effect::When(condition, body) => inner(None, Some(condition), body),
                Effect::Forall(variables, body) => inner(Some(variables), None, body),
            }
        }
        added
    }
    let mut rules = Vec::new();
    let (mut body, mut tests) = (Vec::new(), Vec::new());
    let parameters: Vec<&[Object]> = action.variables.domains.iter().map(Vec::as_slice).collect();
    let mut domains = parameters.clone();
    split(&action.precondition, &mut body, &mut domains, &mut tests);
    let whole = Rule {
        action: number,
        body: body.clone(),
        domains,
        tests: tests.clone(),
        head: Head::Action,
    };
    // An effect's variables have the slots that the precondition's quantifiers had: of those, only
    // what speaks of parameters goes into its rule.
    let own = |atom: &Atom| {
        atom.arguments
            .iter()
            .all(|term| within(*term, parameters.len()))
    };
    let outer = Rule {
        action: number,
        body: body.into_iter().filter(own).collect(),
        domains: parameters,
        tests: Vec::new(),
        head: Head::Action,
    };
    walk(&action.effects, &outer, &mut rules);
    rules.push(whole);
    rules.retain(|rule| !matches!(&rule.head, Head::Effects(added) if added.is_empty()));
    rules
}

fn within(term: Term, slots: usize) -> bool {
    match term {
        Term::Object(_) => true,
        Term::Slot(slot) => slot < slots,
    }
}

/// Whether a condition holds in every state, or in none, as far as what never changes tells.
pub(super) fn always(
    condition: &Condition,
    is_static: &dyn Fn(usize, &[Object]) -> Option<bool>,
    environment: &mut Vec<Object>,
) -> Option<bool> {
    let quantified =
        |variables: &Variables, body: &Condition, wanted: bool, environment: &mut Vec<Object>| {
            let mut known = Some(!wanted);
            each_choice(variables, environment, &mut |environment| {
                match always(body, is_static, environment) {
                    Some(holds) if holds == wanted => known = Some(wanted),
                    None if known == Some(!wanted) => known = None,
                    Some(_) | None => {}
                }
                known != Some(wanted)
            });
            known
        };
    match condition {
        Condition::Atom(atom) => {
            let objects: Vec<Object> = atom.arguments.iter().map(|t| t.at(environment)).collect();
            is_static(atom.predicate, &objects)
        }
        Condition::Same(a, b) => Some(a.at(environment) == b.at(environment)),
        Condition::Not(inner) => always(inner, is_static, environment).map(|known| !known),
        Condition::All(parts) | Condition::Any(parts) => {
            let wanted = matches!(condition, Condition::Any(_));
            let mut known = Some(!wanted);
            for part in parts {
                match always(part, is_static, environment) {
                    Some(holds) if holds == wanted => return Some(wanted),
                    Some(_) => {}
                    None => known = None,
                }
            }
            known
        }
        Condition::Exists(variables, body) => quantified(variables, body, true, environment),
        Condition::Forall(variables, body) => quantified(variables, body, false, environment),
    }
}

/// Calls `visit` with each choice of objects for some variables, until it says `false`.
pub(super) fn each_choice(
    variables: &Variables,
    environment: &mut Vec<Object>,
    visit: &mut dyn FnMut(&mut Vec<Object>) -> bool,
) {
    fn go(
        variables: &Variables,
        depth: usize,
        environment: &mut Vec<Object>,
        visit: &mut dyn FnMut(&mut Vec<Object>) -> bool,
    ) -> bool {
        let Some(domain) = variables.domains.get(depth) else {
            return visit(environment);
        };
        domain.iter().all(|&object| {
            environment[variables.first + depth] = object;
            go(variables, depth + 1, environment, visit)
        })
    }
    go(variables, 0, environment, visit);
}

/// How many atoms may fit, and the place and object by which they are found, if there is one.
type Candidates = (usize, Option<(usize, Object)>);

struct Reaching<'a, 'l, 'c> {
    definition: &'a Definition,
    rules: Vec<Rule<'a>>,
    fluent: Vec<bool>,
    facts: Facts,
    seen: FxHashSet<(usize, Box<[Object]>)>,
    instances: Vec<(usize, Box<[Object]>)>,
    queue: VecDeque<AtomId>,
    limits: &'l mut Limits<'c>,
    tried: u32,
    bytes: usize,
    stopped: Option<StopReason>,
}

/// Finds what may come to hold.
///
/// # Errors
/// [`StopReason::Time`], [`StopReason::Memory`].
pub(super) fn reach(
    definition: &Definition,
    limits: &mut Limits<'_>,
) -> Result<Reached, StopReason> {
    let predicates = definition.predicates.len();
    let mut fluent = vec![false; predicates];
    for action in &definition.actions {
        changed(&action.effects, &mut fluent);
    }
    let mut facts = Facts::new(predicates);
    for (predicate, objects) in &definition.initial {
        facts.add(*predicate, objects);
    }
    let initial = facts.len();
    let numbered = definition.actions.iter().enumerate();
    let mut reaching = Reaching {
        rules: numbered.flat_map(|(n, action)| rules(n, action)).collect(),
        definition,
        fluent,
        facts,
        seen: FxHashSet::default(),
        instances: Vec::new(),
        queue: VecDeque::new(),
        limits,
        tried: 0,
        bytes: 0,
        stopped: None,
    };
    reaching.run(initial)?;
    Ok(Reached {
        facts: reaching.facts,
        initial,
        instances: reaching.instances,
    })
}

fn changed(effects: &[Effect], fluent: &mut [bool]) {
    for effect in effects {
        match effect {
            Effect::Add(atom) | Effect::Delete(atom) => fluent[atom.predicate] = true,
            Effect::When(_, body) | Effect::Forall(_, body) => changed(body, fluent),
        }
    }
}

impl Reaching<'_, '_, '_> {
    fn run(&mut self, initial: usize) -> Result<(), StopReason> {
        // What never changes is there before anything is joined.
        for number in 0..initial as AtomId {
            if self.fluent[self.facts.atom(number).0] {
                self.queue.push_back(number);
            } else {
                self.facts.enter(number);
            }
        }
        let mut triggers: Vec<Vec<(usize, usize)>> = vec![Vec::new(); self.fluent.len()];
        for index in 0..self.rules.len() {
            let mut waits = false;
            for (position, atom) in self.rules[index].body.iter().enumerate() {
                if self.fluent[atom.predicate] {
                    triggers[atom.predicate].push((index, position));
                    waits = true;
                }
            }
            if !waits {
                self.join(index, None);
            }
        }
        while let Some(number) = self.queue.pop_front() {
            self.facts.enter(number);
            for &(rule, position) in &triggers[self.facts.atom(number).0] {
                self.join(rule, Some((position, number)));
            }
            if let Some(reason) = self.stopped {
                return Err(reason);
            }
        }
        self.stopped.map_or(Ok(()), Err)
    }

    /// Finds the bindings of a rule that use an atom at a position.
    fn join(&mut self, rule: usize, new: Option<(usize, AtomId)>) {
        let slots = self.definition.actions[self.rules[rule].action].slots;
        let mut environment = vec![UNBOUND; slots.max(self.rules[rule].domains.len())];
        let mut open: Vec<usize> = (0..self.rules[rule].body.len()).collect();
        if let Some((position, number)) = new {
            open.retain(|&other| other != position);
            let mut bound = Vec::new();
            if self.unify(rule, position, number, &mut environment, &mut bound) {
                self.extend(rule, &mut open, &mut environment);
            }
        } else {
            self.extend(rule, &mut open, &mut environment);
        }
    }

    /// Binds the open slots of a body atom to an atom's objects, and notes which they are.
    fn unify(
        &self,
        rule: usize,
        position: usize,
        number: AtomId,
        environment: &mut [Object],
        bound: &mut Vec<usize>,
    ) -> bool {
        let rule = &self.rules[rule];
        let (_, objects) = self.facts.atom(number);
        let terms = rule.body[position].arguments.iter();
        terms.zip(objects).all(|(term, &object)| match *term {
            Term::Object(wanted) => wanted == object,
            Term::Slot(slot) if environment[slot] != UNBOUND => environment[slot] == object,
            Term::Slot(slot) => {
                // Domains ascend.
                let fits = rule.domains[slot].binary_search(&object).is_ok();
                if fits {
                    environment[slot] = object;
                    bound.push(slot);
                }
                fits
            }
        })
    }

    fn extend(&mut self, rule: usize, open: &mut Vec<usize>, environment: &mut Vec<Object>) {
        self.tried += 1;
        if self.tried.is_multiple_of(4096) {
            let stopped = self.limits.check(self.bytes).err();
            self.stopped = self.stopped.or(stopped);
        }
        if self.stopped.is_some() {
            return;
        }
        // The atom that fewest entered ones fit.
        let mut best: Option<(usize, Candidates)> = None;
        for (index, &position) in open.iter().enumerate() {
            let atom = &self.rules[rule].body[position];
            let mut choice: Candidates = (self.facts.of(atom.predicate).len(), None);
            for (place, term) in atom.arguments.iter().enumerate() {
                let object = match *term {
                    Term::Object(object) => object,
                    Term::Slot(slot) if environment[slot] != UNBOUND => environment[slot],
                    Term::Slot(_) => continue,
                };
                let count = self.facts.with(atom.predicate, place, object).len();
                if count <= choice.0 {
                    choice = (count, Some((place, object)));
                }
            }
            if best.is_none_or(|(_, (count, _))| choice.0 < count) {
                best = Some((index, choice));
            }
        }
        let Some((index, (_, place))) = best else {
            return self.choose(rule, 0, environment);
        };
        let position = open.swap_remove(index);
        let predicate = self.rules[rule].body[position].predicate;
        let candidates = |facts: &Facts| match place {
            Some((place, object)) => facts.with(predicate, place, object).len(),
            None => facts.of(predicate).len(),
        };
        let mut bound = Vec::new();
        // Joining enters no atom, so the lists do not change meanwhile.
        for which in 0..candidates(&self.facts) {
            let number = match place {
                Some((place, object)) => self.facts.with(predicate, place, object)[which],
                None => self.facts.of(predicate)[which],
            };
            if self.unify(rule, position, number, environment, &mut bound) {
                self.extend(rule, open, environment);
            }
            for slot in bound.drain(..) {
                environment[slot] = UNBOUND;
            }
        }
        open.push(position);
        let last = open.len() - 1;
        open.swap(index, last);
    }

    /// Binds what no atom binds.
    fn choose(&mut self, rule: usize, from: usize, environment: &mut Vec<Object>) {
        let domains = &self.rules[rule].domains;
        let Some(slot) = (from..domains.len()).find(|&slot| environment[slot] == UNBOUND) else {
            return self.complete(rule, environment);
        };
        let domain: Vec<Object> = domains[slot].to_vec();
        for object in domain {
            environment[slot] = object;
            self.tried += 1;
            if self.tried.is_multiple_of(4096) {
                let stopped = self.limits.check(self.bytes).err();
                self.stopped = self.stopped.or(stopped);
            }
            if self.stopped.is_some() {
                break;
            }
            self.choose(rule, slot + 1, environment);
        }
        environment[slot] = UNBOUND;
    }

    fn complete(&mut self, rule: usize, environment: &mut Vec<Object>) {
        let this = &self.rules[rule];
        let action = this.action;
        let parameters = self.definition.actions[action].variables.domains.len();
        if matches!(this.head, Head::Action) {
            let key = (action, environment[..parameters].into());
            if self.seen.contains(&key) {
                return;
            }
        }
        let is_static = |predicate: usize, objects: &[Object]| {
            (!self.fluent[predicate]).then(|| self.facts.find(predicate, objects).is_some())
        };
        let before = environment.clone();
        let possible = this.tests.iter().all(|test| {
            let known = always(test, &is_static, environment);
            environment.copy_from_slice(&before);
            known != Some(false)
        });
        if !possible {
            return;
        }
        let mut objects = Vec::new();
        let mut add = |atom: &Atom, facts: &mut Facts, queue: &mut VecDeque<AtomId>| {
            objects.clear();
            objects.extend(atom.arguments.iter().map(|term| term.at(environment)));
            if let Some(number) = facts.add(atom.predicate, &objects) {
                queue.push_back(number);
            }
        };
        match &this.head {
            Head::Action => {
                let objects: Box<[Object]> = environment[..parameters].into();
                self.bytes += 200 + 12 * parameters;
                self.seen.insert((action, objects.clone()));
                self.instances.push((action, objects));
                for effect in &self.definition.actions[action].effects {
                    if let Effect::Add(atom) = effect {
                        add(atom, &mut self.facts, &mut self.queue);
                    }
                }
            }
            Head::Effects(added) => {
                for atom in added {
                    add(atom, &mut self.facts, &mut self.queue);
                }
            }
        }
    }
}
