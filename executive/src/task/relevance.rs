//! Which actions a task can do without. This file guarantees that a task without them has a plan of a
//! cost exactly where it has one with them.

use super::{Action, Formula, Literal};

/// The items that are marked.
pub(crate) fn keep<T>(list: Vec<T>, marked: &[bool]) -> Vec<T> {
    let kept = list.into_iter().zip(marked).filter(|(_, marked)| **marked);
    kept.map(|(item, _)| item).collect()
}

/// Which actions may matter to the goal: those that bring about what it, or another such action,
/// asks for.
pub(crate) fn relevant(facts: usize, goal: &Formula, actions: &[Action]) -> Vec<bool> {
    let mut makers: Vec<Vec<usize>> = vec![Vec::new(); facts * 2];
    for (index, action) in actions.iter().enumerate() {
        for effect in &action.effects {
            let added = effect.add.iter().map(|&f| Literal::positive(f));
            let deleted = effect.delete.iter().map(|&f| Literal::negative(f));
            for literal in added.chain(deleted) {
                makers[literal.index()].push(index);
            }
        }
    }
    let mut wanted = vec![false; facts * 2];
    let mut relevant = vec![false; actions.len()];
    let mut open = Vec::new();
    goal.each_literal(&mut |literal| open.push(literal));
    while let Some(literal) = open.pop() {
        if std::mem::replace(&mut wanted[literal.index()], true) {
            continue;
        }
        for &index in &makers[literal.index()] {
            if !std::mem::replace(&mut relevant[index], true) {
                let action = &actions[index];
                let visit = &mut |literal| open.push(literal);
                action.precondition.each_literal(visit);
                for effect in &action.effects {
                    effect.condition.each_literal(visit);
                }
            }
        }
    }
    relevant
}
