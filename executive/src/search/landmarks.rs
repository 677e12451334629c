//! Landmarks: literals that hold at some time in every plan (Zhu and Givan 2003, Keyder, Richter and
//! Helmert 2010), and the estimate that counts those still to come (Richter and Westphal 2010). This
//! file guarantees that every plan makes each landmark hold; the count is no bound.

use super::relaxed::{ALWAYS, Proposition, Relaxed};
use crate::task::{Literal, Task};
use std::collections::VecDeque;

/// So much work finding landmarks may take, in elements of sets looked at, for each proposition
/// and operator; beyond, the search does without.
const PATIENCE: usize = 60;

/// So many literals may be in a landmark of which one holds at some time.
const MOST_CHOICES: usize = 4;

/// The landmarks of a task.
#[derive(Debug)]
pub(super) struct Landmarks {
    /// Of each, one literal holds at some time.
    literals: Vec<Vec<Literal>>,
    /// Landmarks that must hold at the end.
    is_goal: Vec<bool>,
    /// The landmarks that each landmark is needed for, at the moment before it first holds.
    enables: Vec<Vec<u32>>,
}

impl Landmarks {
    /// None at all: a search that has them goes by its other estimate alone.
    pub(super) fn none() -> Self {
        Self {
            literals: Vec::new(),
            is_goal: Vec::new(),
            enables: Vec::new(),
        }
    }

    /// Finds them.
    pub(super) fn new(task: &Task, relaxed: &Relaxed) -> Self {
        let none = Self::none();
        let Some(before) = sets(task, relaxed) else {
            return none;
        };
        let Some(of_goal) = &before[relaxed.goal as usize] else {
            return none;
        };
        let mut number = vec![None; relaxed.propositions];
        let mut literals = Vec::new();
        let mut chosen = Vec::new();
        for &proposition in of_goal {
            if let Some(literal) = relaxed.literal(proposition) {
                number[proposition as usize] = Some(literals.len() as u32);
                literals.push(vec![literal]);
                chosen.push(proposition);
            }
        }
        let goal_needs = relaxed.added_by.of(relaxed.goal).iter();
        let goal_needs: Vec<Proposition> = goal_needs
            .flat_map(|&operator| relaxed.operators[operator as usize].needs.clone())
            .collect();
        let mut enables = vec![Vec::new(); literals.len()];
        for (index, &landmark) in (0..).zip(&chosen) {
            for need in first_needs(relaxed, &before, landmark) {
                if let Some(enabler) = number[need as usize] {
                    enables[enabler as usize].push(index);
                }
            }
        }
        let mut is_goal: Vec<bool> = chosen.iter().map(|p| goal_needs.contains(p)).collect();
        for &landmark in &chosen {
            let either = first_choice(relaxed, &before, landmark);
            if !either.is_empty() && !literals.contains(&either) {
                literals.push(either);
                is_goal.push(false);
                enables.push(Vec::new());
            }
        }
        Self {
            literals,
            is_goal,
            enables,
        }
    }

    /// Words that the landmarks accepted on a way take.
    pub(super) fn words(&self) -> usize {
        self.literals.len().div_ceil(64)
    }

    /// Accepts what holds in a state; `accepted` are those of the way before it.
    pub(super) fn accept(&self, state: &[u64], accepted: &mut [u64]) {
        for (index, either) in self.literals.iter().enumerate() {
            if accepted[index / 64] >> (index % 64) & 1 == 0
                && either.iter().any(|literal| literal.holds(state))
            {
                accepted[index / 64] |= 1 << (index % 64);
            }
        }
    }

    /// How many landmarks are still to come: those not accepted yet, and those that do not hold now
    /// but are needed again.
    pub(super) fn count(&self, state: &[u64], accepted: &[u64]) -> u64 {
        let is_accepted = |index: usize| accepted[index / 64] >> (index % 64) & 1 == 1;
        let mut count = 0;
        for (index, either) in self.literals.iter().enumerate() {
            let again = || {
                let needed = self.enables[index].iter();
                (self.is_goal[index] || needed.into_iter().any(|&o| !is_accepted(o as usize)))
                    && !either.iter().any(|literal| literal.holds(state))
            };
            count += u64::from(!is_accepted(index) || again());
        }
        count
    }
}

/// For each proposition that can be reached what must hold before or with it, ascending; `None`
/// where it takes too long.
fn sets(task: &Task, relaxed: &Relaxed) -> Option<Vec<Option<Vec<Proposition>>>> {
    let mut sets: Vec<Option<Vec<Proposition>>> = vec![None; relaxed.propositions];
    let mut missing: Vec<usize> = relaxed.operators.iter().map(|o| o.needs.len()).collect();
    let mut queue = VecDeque::new();
    let mut queued = vec![false; relaxed.operators.len()];
    let mut patience = PATIENCE * (relaxed.propositions + relaxed.operators.len()) + 100_000;
    let arrive = |proposition: Proposition,
                  first: bool,
                  missing: &mut Vec<usize>,
                  queue: &mut VecDeque<u32>,
                  queued: &mut Vec<bool>| {
        for &operator in relaxed.needed_by.of(proposition) {
            let index = operator as usize;
            if first {
                missing[index] -= 1;
            }
            if missing[index] == 0 && !std::mem::replace(&mut queued[index], true) {
                queue.push_back(operator);
            }
        }
    };
    let mut holding = Vec::new();
    relaxed.each_holding(task.initial(), |proposition| holding.push(proposition));
    for &proposition in &holding {
        sets[proposition as usize] = Some(vec![proposition]);
    }
    for proposition in holding {
        arrive(proposition, true, &mut missing, &mut queue, &mut queued);
    }
    while let Some(operator) = queue.pop_front() {
        queued[operator as usize] = false;
        let operator = &relaxed.operators[operator as usize];
        let mut all: Vec<Proposition> = Vec::new();
        for &need in &operator.needs {
            all.extend(
                sets[need as usize]
                    .iter()
                    .flatten()
                    .filter(|&&p| p != ALWAYS),
            );
        }
        all.sort_unstable();
        all.dedup();
        patience = patience.checked_sub(all.len() * (1 + operator.adds.len()))?;
        for &add in &operator.adds {
            let set = &mut sets[add as usize];
            let (changed, first) = match set {
                None => {
                    let mut new = all.clone();
                    if let Err(place) = new.binary_search(&add) {
                        new.insert(place, add);
                    }
                    *set = Some(new);
                    (true, true)
                }
                Some(known) => {
                    let before = known.len();
                    known.retain(|p| *p == add || all.binary_search(p).is_ok());
                    (known.len() < before, false)
                }
            };
            if changed {
                arrive(add, first, &mut missing, &mut queue, &mut queued);
            }
        }
    }
    Some(sets)
}

/// The operators that may be the first to add a landmark.
fn first_achievers<'r>(
    relaxed: &'r Relaxed,
    before: &'r [Option<Vec<Proposition>>],
    landmark: Proposition,
) -> impl Iterator<Item = &'r [Proposition]> {
    let operators = relaxed.added_by.of(landmark).iter();
    let needs = operators.map(|&operator| relaxed.operators[operator as usize].needs.as_slice());
    // What cannot be reached, or only after the landmark, is none.
    needs.filter(move |needs| {
        needs.iter().all(|&need| match &before[need as usize] {
            None => false,
            Some(set) => set.binary_search(&landmark).is_err(),
        })
    })
}

/// What every operator that may be the first to add a landmark needs.
fn first_needs(
    relaxed: &Relaxed,
    before: &[Option<Vec<Proposition>>],
    landmark: Proposition,
) -> Vec<Proposition> {
    let mut achievers = first_achievers(relaxed, before, landmark);
    let mut common = achievers.next().unwrap_or_default().to_vec();
    for needs in achievers {
        common.retain(|need| needs.contains(need));
    }
    common
}

/// Some literals of which one must hold before a landmark does, because each operator that may be
/// the first to add it needs one of them; none where there are too many, or one needs several.
fn first_choice(
    relaxed: &Relaxed,
    before: &[Option<Vec<Proposition>>],
    landmark: Proposition,
) -> Vec<Literal> {
    let common = first_needs(relaxed, before, landmark);
    let mut either = Vec::new();
    for needs in first_achievers(relaxed, before, landmark) {
        // What holds at first has no set beside itself, and its way is no landmark.
        let mut own = needs.iter().filter(|need| {
            !common.contains(need)
                && before[**need as usize]
                    .as_ref()
                    .is_some_and(|s| s.len() > 1)
        });
        let (Some(&need), None) = (own.next(), own.next()) else {
            return Vec::new();
        };
        let Some(literal) = relaxed.literal(need) else {
            return Vec::new();
        };
        if !either.contains(&literal) {
            either.push(literal);
        }
    }
    either.sort_unstable();
    if either.len() < 2 || either.len() > MOST_CHOICES {
        return Vec::new();
    }
    either
}
