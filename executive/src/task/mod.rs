//! Ground planning tasks: facts that hold or not, and actions that change them.
//!
//! This module owns what a ground action means; every other part of the planner is judged by
//! [`Task::successor`]. It knows nothing of graphs and rules.

mod formula;
mod relevance;

pub use formula::{Formula, Literal};

pub(crate) use formula::conjuncts;
pub(crate) use relevance::{keep, relevant};

/// A proposition of a task, by number.
pub type Fact = u32;

/// A cost in millionths of the unit that rules use. Sums of integers are exact, so that an
/// admissible heuristic stays so and equal plans cost the same whatever the order of summation.
pub type Micro = u64;

/// No action costs more: the costs of ten thousand actions still have a sum.
pub const MOST_COST: f64 = 1e9;

/// A cost as an integer: rounded to the nearest millionth, not below 0.
pub fn micro(cost: f64) -> Micro {
    (cost.max(0.0) * 1e6).round() as Micro
}

/// The other way.
pub fn from_micro(cost: Micro) -> f64 {
    cost as f64 / 1e6
}

/// The facts that hold, one bit each; [`Task::words`] words.
pub type State = Vec<u64>;

/// Whether a fact holds.
pub fn holds(state: &[u64], fact: Fact) -> bool {
    state[fact as usize / 64] >> (fact % 64) & 1 == 1
}

/// Makes a fact hold.
pub fn add(state: &mut [u64], fact: Fact) {
    state[fact as usize / 64] |= 1 << (fact % 64);
}

/// Makes a fact not hold.
pub fn delete(state: &mut [u64], fact: Fact) {
    state[fact as usize / 64] &= !(1 << (fact % 64));
}

/// What changes where `condition` holds in the state before the action.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Effect {
    /// When it happens; [`Formula::TRUE`] for always.
    pub condition: Formula,
    /// Facts that hold afterwards.
    pub add: Vec<Fact>,
    /// Facts that do not hold afterwards, unless an effect of the same action adds them.
    pub delete: Vec<Fact>,
}

/// A rule at a binding.
#[derive(Debug, Clone, PartialEq)]
pub struct Action {
    /// What must hold before it.
    pub precondition: Formula,
    /// What it changes.
    pub effects: Vec<Effect>,
    /// What it costs.
    pub cost: Micro,
    /// Probability that it succeeds, in [0, 1]; see [`Task::cost_after`].
    pub success: f64,
}

impl Action {
    /// An action that always succeeds.
    pub fn new(precondition: Formula, effects: Vec<Effect>, cost: Micro) -> Self {
        Self {
            precondition,
            effects,
            cost,
            success: 1.0,
        }
    }
}

/// A planning task.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    facts: usize,
    initial: State,
    goal: Formula,
    actions: Vec<Action>,
    /// The literals that a precondition demands outright, by action: the quick part of the test.
    demanded: Vec<Vec<Literal>>,
    /// Whether something besides `demanded` is in the precondition.
    more: Vec<bool>,
    /// The actions to look at where a fact holds: each action waits on one of its demanded facts.
    waiting: Vec<Vec<u32>>,
    /// Actions that demand no positive literal.
    eager: Vec<u32>,
}

impl Task {
    /// A task over the facts `0..facts` of which `initial` hold at first.
    ///
    /// # Panics
    /// Where a fact beyond `facts` is used.
    pub fn new(facts: usize, initial: &[Fact], goal: Formula, actions: Vec<Action>) -> Self {
        let mut state = vec![0; facts.div_ceil(64).max(1)];
        for &fact in initial {
            assert!((fact as usize) < facts, "fact {fact} of {facts}");
            add(&mut state, fact);
        }
        let demanded: Vec<Vec<Literal>> = actions
            .iter()
            .map(|action| conjuncts(&action.precondition).0)
            .collect();
        let more = actions
            .iter()
            .map(|action| !conjuncts(&action.precondition).1.is_empty())
            .collect();
        let mut popularity = vec![0usize; facts];
        for literal in demanded.iter().flatten().filter(|l| !l.negated()) {
            popularity[literal.fact() as usize] += 1;
        }
        let mut waiting = vec![Vec::new(); facts];
        let mut eager = Vec::new();
        for (index, literals) in (0..).zip(&demanded) {
            let rarest = literals
                .iter()
                .filter(|literal| !literal.negated())
                .map(|literal| literal.fact() as usize)
                .min_by_key(|&fact| (popularity[fact], fact));
            match rarest {
                Some(fact) => waiting[fact].push(index),
                None => eager.push(index),
            }
        }
        Self {
            facts,
            initial: state,
            goal,
            actions,
            demanded,
            more,
            waiting,
            eager,
        }
    }

    /// How many facts there are.
    pub fn facts(&self) -> usize {
        self.facts
    }

    /// How many words a state has.
    pub fn words(&self) -> usize {
        self.initial.len()
    }

    /// The state at first.
    pub fn initial(&self) -> &[u64] {
        &self.initial
    }

    /// What shall hold.
    pub fn goal(&self) -> &Formula {
        &self.goal
    }

    /// The actions.
    pub fn actions(&self) -> &[Action] {
        &self.actions
    }

    /// Whether the goal holds.
    pub fn is_goal(&self, state: &[u64]) -> bool {
        self.goal.holds(state)
    }

    /// Whether an action's precondition holds.
    pub fn is_applicable(&self, state: &[u64], action: usize) -> bool {
        self.demanded[action]
            .iter()
            .all(|literal| literal.holds(state))
            && (!self.more[action] || self.actions[action].precondition.holds(state))
    }

    /// The applicable actions, into `found`, ascending.
    pub fn applicable(&self, state: &[u64], found: &mut Vec<u32>) {
        found.clear();
        found.extend(&self.eager);
        for (index, &word) in state.iter().enumerate() {
            let mut rest = word;
            while rest != 0 {
                let fact = index * 64 + rest.trailing_zeros() as usize;
                found.extend(&self.waiting[fact]);
                rest &= rest - 1;
            }
        }
        found.retain(|&action| self.is_applicable(state, action as usize));
        found.sort_unstable();
    }

    /// The state after an action, into `next`: all conditions are read before, and what is both
    /// deleted and added holds.
    pub fn successor(&self, state: &[u64], action: usize, next: &mut State) {
        next.clear();
        next.extend_from_slice(state);
        let effects = &self.actions[action].effects;
        for effect in effects.iter().filter(|e| e.condition.holds(state)) {
            effect.delete.iter().for_each(|&fact| delete(next, fact));
        }
        for effect in effects.iter().filter(|e| e.condition.holds(state)) {
            effect.add.iter().for_each(|&fact| add(next, fact));
        }
    }

    /// What a plan costs with `action` at its end, `before` being its cost up to there: an action
    /// that fails wastes what led to it, so (1 - success) of that is paid again.
    pub fn cost_after(&self, before: Micro, action: usize) -> Micro {
        let action = &self.actions[action];
        let wasted = if action.success < 1.0 {
            ((1.0 - action.success.max(0.0)) * before as f64).round() as Micro
        } else {
            0
        };
        before.saturating_add(action.cost).saturating_add(wasted)
    }

    /// The cost of a sequence of actions, or `None` where it is no plan: the independent judge of
    /// what the searches find.
    pub fn plan_cost(&self, plan: &[usize]) -> Option<Micro> {
        let (mut state, mut next, mut cost) = (self.initial.clone(), State::new(), 0);
        for &action in plan {
            if action >= self.actions.len() || !self.actions[action].precondition.holds(&state) {
                return None;
            }
            cost = self.cost_after(cost, action);
            self.successor(&state, action, &mut next);
            std::mem::swap(&mut state, &mut next);
        }
        self.is_goal(&state).then_some(cost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn task() -> Task {
        // Fact 0: at home; 1: at work; 2: tired.
        let go = Action::new(
            Formula::And(vec![
                Formula::Literal(Literal::positive(0)),
                Formula::Literal(Literal::negative(2)),
            ]),
            vec![
                Effect {
                    condition: Formula::TRUE,
                    add: vec![1],
                    delete: vec![0, 1],
                },
                Effect {
                    condition: Formula::Literal(Literal::positive(1)),
                    add: vec![2],
                    delete: vec![],
                },
            ],
            micro(1.5),
        );
        Task::new(3, &[0], Formula::Literal(Literal::positive(1)), vec![go])
    }

    #[test]
    fn an_action_applies_where_its_literals_hold_and_adds_win_over_deletes() {
        let task = task();
        let mut found = Vec::new();
        task.applicable(task.initial(), &mut found);
        assert_eq!(found, [0]);
        let mut next = State::new();
        task.successor(task.initial(), 0, &mut next);
        assert_eq!(next, [0b010]);
        task.applicable(&next, &mut found);
        assert!(found.is_empty());
    }

    #[test]
    fn conditional_effects_read_the_state_before() {
        let task = task();
        let mut next = State::new();
        task.successor(&[0b011], 0, &mut next);
        assert_eq!(next, [0b110]);
    }

    #[test]
    fn only_what_reaches_the_goal_is_a_plan() {
        let task = task();
        assert_eq!(task.plan_cost(&[0]), Some(1_500_000));
        assert_eq!(task.plan_cost(&[]), None);
        assert_eq!(task.plan_cost(&[0, 0]), None);
        assert_eq!(task.plan_cost(&[7]), None);
    }

    #[test]
    fn a_failure_wastes_what_led_to_it() {
        let mut action = Action::new(Formula::TRUE, vec![], micro(2.0));
        action.success = 0.75;
        let task = Task::new(1, &[], Formula::TRUE, vec![action]);
        assert_eq!(task.cost_after(micro(10.0), 0), micro(14.5));
    }
}
