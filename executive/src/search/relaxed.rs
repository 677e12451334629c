//! A task without deletes: what both heuristics look at. Positive and negative literals become
//! propositions of their own that, once reached, stay; an `Or` becomes a proposition that any of
//! its parts brings about at no cost; each conditional effect becomes an operator of its own that
//! shares its action's cost. This file guarantees that every plan of the task is a plan of this.

use crate::task::{Formula, Literal, Micro, Task, conjuncts, holds};
use rustc_hash::FxHashMap;

/// A proposition of the relaxed task, by number.
pub(super) type Proposition = u32;

/// Holds in every state, so that every operator has a precondition.
pub(super) const ALWAYS: Proposition = 0;

/// What an operator without an action has instead.
pub(super) const NO_ACTION: u32 = u32::MAX;

/// Makes propositions hold once others do.
#[derive(Debug, Clone)]
pub(super) struct Operator {
    pub(super) needs: Vec<Proposition>,
    pub(super) adds: Vec<Proposition>,
    /// The action that it is a part of, or [`NO_ACTION`].
    pub(super) action: u32,
}

/// Lists one behind another, each found by its number.
#[derive(Debug, Clone)]
pub(super) struct Lists {
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Lists {
    fn new<'a>(lists: impl Iterator<Item = &'a Vec<u32>>) -> Self {
        let (mut starts, mut items) = (vec![0], Vec::new());
        for list in lists {
            items.extend_from_slice(list);
            starts.push(items.len() as u32);
        }
        Self { starts, items }
    }

    /// The list of a number.
    pub(super) fn of(&self, number: u32) -> &[u32] {
        let number = number as usize;
        &self.items[self.starts[number] as usize..self.starts[number + 1] as usize]
    }
}

/// A task without deletes.
#[derive(Debug, Clone)]
pub(super) struct Relaxed {
    pub(super) propositions: usize,
    pub(super) operators: Vec<Operator>,
    pub(super) goal: Proposition,
    /// Operators that need a proposition.
    pub(super) needed_by: Lists,
    /// Operators that add a proposition.
    pub(super) added_by: Lists,
    /// Propositions that an operator adds, as in `operators`.
    pub(super) adds: Lists,
    /// The literal of each proposition that stands for one.
    literals: Vec<(Literal, Proposition)>,
    literal_of: Vec<Option<Literal>>,
}

struct Builder<'a> {
    task: &'a Task,
    literals: Vec<Option<Proposition>>,
    /// Propositions of disjunctions, so that equal ones are one.
    disjunctions: FxHashMap<&'a Formula, Proposition>,
    count: u32,
    operators: Vec<Operator>,
}

impl<'a> Builder<'a> {
    fn fresh(&mut self) -> Proposition {
        self.count += 1;
        self.count - 1
    }

    fn needs(&mut self, formula: &'a Formula) -> Vec<Proposition> {
        let (literals, rest) = conjuncts(formula);
        let mut needs: Vec<Proposition> = literals
            .into_iter()
            .map(|literal| match self.literals[literal.index()] {
                Some(known) => known,
                None => {
                    let new = self.fresh();
                    *self.literals[literal.index()].insert(new)
                }
            })
            .collect();
        for part in rest {
            needs.push(self.disjunction(part));
        }
        needs
    }

    /// The proposition of an `Or` (or of an `And` inside one).
    fn disjunction(&mut self, formula: &'a Formula) -> Proposition {
        if let Some(&known) = self.disjunctions.get(formula) {
            return known;
        }
        let proposition = self.fresh();
        self.disjunctions.insert(formula, proposition);
        let parts = match formula {
            Formula::Or(parts) => parts.as_slice(),
            other => std::slice::from_ref(other),
        };
        for part in parts {
            let needs = self.needs(part);
            self.push(needs, vec![proposition], NO_ACTION);
        }
        proposition
    }

    fn push(&mut self, mut needs: Vec<Proposition>, mut adds: Vec<Proposition>, action: u32) {
        for list in [&mut needs, &mut adds] {
            list.sort_unstable();
            list.dedup();
        }
        adds.retain(|proposition| needs.binary_search(proposition).is_err());
        if adds.is_empty() {
            return;
        }
        if needs.is_empty() {
            needs.push(ALWAYS);
        }
        self.operators.push(Operator {
            needs,
            adds,
            action,
        });
    }

    fn conditions(&mut self) -> Vec<(Vec<Proposition>, u32, usize)> {
        let task = self.task;
        let mut found = Vec::new();
        for (index, action) in (0..).zip(task.actions()) {
            let needs = self.needs(&action.precondition);
            for (which, effect) in action.effects.iter().enumerate() {
                let mut all = needs.clone();
                all.extend(self.needs(&effect.condition));
                found.push((all, index, which));
            }
        }
        found
    }
}

impl Relaxed {
    /// The task without its deletes.
    pub(super) fn new(task: &Task) -> Self {
        let mut builder = Builder {
            task,
            literals: vec![None; task.facts() * 2],
            disjunctions: FxHashMap::default(),
            count: ALWAYS + 1,
            operators: Vec::new(),
        };
        let goal_needs = builder.needs(task.goal());
        // Only literals that some condition names become propositions, so conditions come first.
        let conditions = builder.conditions();
        for (needs, index, which) in conditions {
            let effect = &task.actions()[index as usize].effects[which];
            let added = effect.add.iter().map(|&f| Literal::positive(f));
            let deleted = effect.delete.iter().map(|&f| Literal::negative(f));
            let adds = added
                .chain(deleted)
                .filter_map(|literal| builder.literals[literal.index()])
                .collect();
            builder.push(needs, adds, index);
        }
        let goal = builder.fresh();
        builder.push(goal_needs, vec![goal], NO_ACTION);
        let propositions = builder.count as usize;
        let mut relaxed = Self {
            propositions,
            goal,
            needed_by: Lists::new([].iter()),
            added_by: Lists::new([].iter()),
            adds: Lists::new(builder.operators.iter().map(|operator| &operator.adds)),
            literals: Vec::new(),
            literal_of: vec![None; propositions],
            operators: builder.operators,
        };
        for fact in 0..task.facts() as u32 {
            for literal in [Literal::positive(fact), Literal::negative(fact)] {
                if let Some(proposition) = builder.literals[literal.index()] {
                    relaxed.literals.push((literal, proposition));
                    relaxed.literal_of[proposition as usize] = Some(literal);
                }
            }
        }
        let mut needed_by = vec![Vec::new(); propositions];
        let mut added_by = vec![Vec::new(); propositions];
        for (index, operator) in (0..).zip(&relaxed.operators) {
            for &need in &operator.needs {
                needed_by[need as usize].push(index);
            }
            for &add in &operator.adds {
                added_by[add as usize].push(index);
            }
        }
        relaxed.needed_by = Lists::new(needed_by.iter());
        relaxed.added_by = Lists::new(added_by.iter());
        relaxed
    }

    /// The literal that a proposition stands for; others stand for disjunctions or the goal.
    pub(super) fn literal(&self, proposition: Proposition) -> Option<Literal> {
        self.literal_of[proposition as usize]
    }

    /// Calls `visit` with each proposition that holds in `state`.
    pub(super) fn each_holding(&self, state: &[u64], mut visit: impl FnMut(Proposition)) {
        visit(ALWAYS);
        for &(literal, proposition) in &self.literals {
            if holds(state, literal.fact()) != literal.negated() {
                visit(proposition);
            }
        }
    }

    /// The cost of an operator under `costs` of actions.
    pub(super) fn cost(&self, operator: usize, costs: &[Micro]) -> Micro {
        match self.operators[operator].action {
            NO_ACTION => 0,
            action => costs[action as usize],
        }
    }

    /// The propositions of those literals that conditions name.
    pub(super) fn of_literals(&self) -> FxHashMap<Literal, Proposition> {
        self.literals.iter().copied().collect()
    }

    /// Which actions can ever be applied, and which literals (by [`Literal::index`]) can ever
    /// hold, by the relaxed task; and whether the goal can.
    pub(super) fn reachable(&self, task: &Task) -> Reachable {
        let mut reached = vec![false; self.propositions];
        let mut open = Vec::new();
        self.each_holding(task.initial(), |proposition| {
            reached[proposition as usize] = true;
            open.push(proposition);
        });
        let mut missing: Vec<usize> = self.operators.iter().map(|o| o.needs.len()).collect();
        while let Some(proposition) = open.pop() {
            for &operator in self.needed_by.of(proposition) {
                let operator = operator as usize;
                missing[operator] -= 1;
                if missing[operator] == 0 {
                    for &add in &self.operators[operator].adds {
                        if !std::mem::replace(&mut reached[add as usize], true) {
                            open.push(add);
                        }
                    }
                }
            }
        }
        let mut literals = vec![true; task.facts() * 2];
        for &(literal, proposition) in &self.literals {
            literals[literal.index()] = reached[proposition as usize];
        }
        Reachable {
            goal: reached[self.goal as usize],
            literals,
        }
    }
}

/// What the relaxed task can reach.
#[derive(Debug, Clone)]
pub(super) struct Reachable {
    /// Whether the goal can hold.
    pub(super) goal: bool,
    /// Whether each literal can hold, by [`Literal::index`]; true for those that nothing needs.
    pub(super) literals: Vec<bool>,
}
