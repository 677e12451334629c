//! One rule's left side laid over another's.
//!
//! Guarantee: every way to do so comes once, those with the fewest nodes first, up to
//! [`OVERLAY_LIMIT`](super::OVERLAY_LIMIT); ways where the sides alone show that nothing is disabled are left out.

use super::OVERLAY_LIMIT;
use crate::analysis::complete::{Draft, Link, Places};
use crate::analysis::kinds::{Kind, Kinds};
use crate::{PatternEdge, Rule};

/// How many steps are taken for two rules.
const STEPS: usize = 20_000;

/// A bound variable, and the type that a node for it can have.
type Variable<'g> = (&'g str, Kind);

/// A variable of the second rule on one of the first.
type Shared = (usize, usize);

/// Two rules to be laid over each other.
pub(super) struct Sides<'g> {
    pub(super) first: Vec<Variable<'g>>,
    pub(super) second: Vec<Variable<'g>>,
    rules: [&'g Rule; 2],
    kinds: &'g Kinds<'g>,
    /// Of these sets of variables one must be shared; where there is no list, that cannot be told.
    needed: Option<Vec<Vec<Shared>>>,
}

/// Bound variables with the type that a node for them can have.
fn variables<'g>(kinds: &Kinds<'g>, rule: &'g Rule) -> Option<Vec<Variable<'g>>> {
    let narrowed = |node: &'g crate::PatternNode| {
        let parameters = rule.parameters.iter();
        let same = parameters.filter(|p| p.variable == node.variable);
        let mut kind = kinds.find(&node.type_name)?;
        for parameter in same {
            kind = kinds.common(kind, kinds.find(&parameter.type_name)?)?;
        }
        Some((&*node.variable, kind))
    };
    rule.bound_nodes().map(narrowed).collect()
}

fn place(variables: &[Variable], name: &str) -> Option<usize> {
    variables.iter().position(|(variable, _)| *variable == name)
}

impl<'g> Sides<'g> {
    pub(super) fn new(kinds: &'g Kinds<'g>, first: &'g Rule, second: &'g Rule) -> Option<Self> {
        let mut sides = Self {
            first: variables(kinds, first)?,
            second: variables(kinds, second)?,
            rules: [first, second],
            kinds,
            needed: None,
        };
        if second.precondition.is_none() && first.effect.is_empty() {
            sides.needed = Some(sides.needs());
        }
        Some(sides)
    }

    pub(super) fn nodes(&self) -> usize {
        self.first.len() + self.second.len()
    }

    /// What must be shared for the sides of the first rule to disable the second.
    fn needs(&self) -> Vec<Vec<Shared>> {
        let [first, second] = self.rules;
        let mut needs = Vec::new();
        for (index, (name, kind)) in self.first.iter().enumerate() {
            let after = match first.right.node(name) {
                Some(after) => self.kinds.find(&after.type_name),
                None if first.left.node(name).is_none() => Some(*kind),
                None => None,
            };
            for (other, (_, wanted)) in self.second.iter().enumerate() {
                if !after.is_some_and(|after| self.kinds.is_subtype(after, *wanted)) {
                    needs.push(vec![(other, index)]);
                }
            }
        }
        let of_sides = |edges: &'g [PatternEdge]| edges.iter();
        for looked_at in &second.left.edges {
            for edge in of_sides(&first.left.edges).chain(of_sides(&first.right.edges)) {
                let wanted = first.right.edge(&edge.from, &edge.label, &edge.to);
                let there = wanted.is_some_and(|edge| !edge.negated);
                let ends = [(&looked_at.from, &edge.from), (&looked_at.to, &edge.to)];
                let shared = ends
                    .map(|(two, one)| Some((place(&self.second, two)?, place(&self.first, one)?)));
                if looked_at.label == edge.label
                    && looked_at.negated == there
                    && let [Some(from), Some(to)] = shared
                {
                    needs.push(vec![from, to]);
                }
            }
        }
        needs
    }
}

/// One rule laid over another.
pub(super) struct Laid {
    pub(super) draft: Draft,
    pub(super) first: Places,
    pub(super) second: Places,
}

/// The ways to lay one rule over another.
pub(super) struct Overlays<'a, 'g> {
    sides: &'a Sides<'g>,
    found: usize,
    steps: usize,
}

/// By variable of the second rule, the variable of the first that is the same node.
type Choice = Vec<Option<usize>>;

impl<'a, 'g> Overlays<'a, 'g> {
    pub(super) fn new(sides: &'a Sides<'g>) -> Self {
        Self {
            sides,
            found: 0,
            steps: 0,
        }
    }

    /// Those where so many variables of the second rule are beside the first.
    pub(super) fn with_beside(&mut self, beside: usize) -> Vec<Laid> {
        let mut choices = Vec::new();
        self.lay(beside, &mut Vec::new(), &mut choices);
        choices
            .iter()
            .filter_map(|choice| self.drawn(choice))
            .collect()
    }

    fn lay(&mut self, beside: usize, choice: &mut Choice, found: &mut Vec<Choice>) {
        self.steps += 1;
        if self.found >= OVERLAY_LIMIT || self.steps >= STEPS {
            return;
        }
        let sides = self.sides;
        let Some((_, kind)) = sides.second.get(choice.len()) else {
            let shares = |(two, one): &Shared| choice[*two] == Some(*one);
            let disables =
                |needed: &Vec<Vec<Shared>>| needed.iter().any(|all| all.iter().all(shares));
            // The identity is no second match.
            let [first, second] = sides.rules;
            let identity = first.name == second.name
                && choice
                    .iter()
                    .enumerate()
                    .all(|(two, one)| *one == Some(two));
            if !identity && sides.needed.as_ref().is_none_or(disables) {
                self.found += 1;
                found.push(choice.clone());
            }
            return;
        };
        let rest = sides.second.len() - choice.len();
        if rest > beside {
            for (index, (_, exact)) in sides.first.iter().enumerate() {
                if !choice.contains(&Some(index)) && sides.kinds.common(*exact, *kind).is_some() {
                    choice.push(Some(index));
                    self.lay(beside, choice, found);
                    choice.pop();
                }
            }
        }
        if beside > 0 {
            choice.push(None);
            self.lay(beside - 1, choice, found);
            choice.pop();
        }
    }

    /// Both left sides as one graph, unless one has a link that the other forbids.
    fn drawn(&self, choice: &Choice) -> Option<Laid> {
        let sides = self.sides;
        let mut laid = Laid {
            draft: Draft::default(),
            first: Places::new(),
            second: Places::new(),
        };
        let Laid {
            draft,
            first: firsts,
            second: seconds,
        } = &mut laid;
        for (index, (name, kind)) in sides.first.iter().enumerate() {
            firsts.insert((*name).to_owned(), index);
            let other = choice.iter().position(|shared| *shared == Some(index));
            let other = other.map(|other| sides.second[other].1);
            let both = other.map_or(Some(*kind), |other| sides.kinds.common(*kind, other))?;
            let kind = sides.kinds.name(both).to_owned();
            draft.nodes.push(((*name).to_owned(), kind));
        }
        for ((name, kind), shared) in sides.second.iter().zip(choice) {
            let place = shared.unwrap_or_else(|| {
                let fresh = draft.fresh(name);
                let kind = sides.kinds.name(*kind).to_owned();
                draft.nodes.push((fresh, kind));
                draft.nodes.len() - 1
            });
            seconds.insert((*name).to_owned(), place);
        }
        let [first, second] = sides.rules;
        let goes = links(draft, first, firsts) && links(draft, second, seconds);
        goes.then_some(laid)
    }
}

/// Draws the links of a left side; whether they go with what is drawn.
fn links(draft: &mut Draft, rule: &Rule, places: &Places) -> bool {
    rule.left.edges.iter().all(|edge| {
        let (Some(&from), Some(&to)) = (places.get(&*edge.from), places.get(&*edge.to)) else {
            return false;
        };
        let link: Link = (from, edge.label.to_string(), to);
        if edge.negated {
            draft.absent.insert(link.clone());
            !draft.links.contains(&link)
        } else {
            draft.links.insert(link.clone());
            !draft.absent.contains(&link)
        }
    })
}
