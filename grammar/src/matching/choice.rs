//! Quantified variables: which nodes have to be looked at.
//!
//! Guarantee: no choice is left out at which the quantified formula could come out otherwise than
//! it does without it.

use super::domain::Domain;
use super::evaluate::{Environment, node};
use super::program::{Link, Slot, Test};
use dsr::{EdgeKey, NodeId, ReadError, Snapshot};

/// Variables in neighbouring slots, and where their nodes are looked for.
#[derive(Debug)]
pub(crate) struct Choices {
    first: usize,
    variables: Vec<Variable>,
}

#[derive(Debug)]
struct Variable {
    domain: Domain,
    /// Only nodes that this link joins to a node bound before can matter.
    near: Option<Link>,
}

type Nodes<'a> = Box<dyn Iterator<Item = Result<NodeId, ReadError>> + 'a>;

impl Choices {
    pub(crate) fn new(first: usize, domains: impl IntoIterator<Item = Domain>) -> Self {
        let variables = domains.into_iter();
        let variables = variables
            .map(|domain| Variable { domain, near: None })
            .collect();
        Self { first, variables }
    }

    /// Looks only at choices at which `test` can come out as `outcome`: those that the links
    /// which then must be there allow.
    pub(crate) fn narrow(&mut self, test: &Test, outcome: bool) {
        let mut links = Vec::new();
        needed(test, outcome, &mut links);
        for (index, variable) in self.variables.iter_mut().enumerate() {
            let slot = self.first + index;
            variable.near = links
                .iter()
                .find(|link| {
                    (link.from == slot && link.to < slot) || (link.to == slot && link.from < slot)
                })
                .copied();
        }
    }

    /// Puts every choice that matters into the slots, until `visit` gives something. The slots
    /// keep the choice that it gave something for.
    pub(crate) fn each<T, E: From<ReadError>>(
        &self,
        snapshot: &Snapshot,
        environment: &mut Environment,
        visit: &mut impl FnMut(&mut Environment) -> Result<Option<T>, E>,
    ) -> Result<Option<T>, E> {
        self.descend(0, false, snapshot, environment, visit)
    }

    /// The same, by ascending ids.
    pub(crate) fn each_in_order<T, E: From<ReadError>>(
        &self,
        snapshot: &Snapshot,
        environment: &mut Environment,
        visit: &mut impl FnMut(&mut Environment) -> Result<Option<T>, E>,
    ) -> Result<Option<T>, E> {
        self.descend(0, true, snapshot, environment, visit)
    }

    fn descend<T, E: From<ReadError>>(
        &self,
        index: usize,
        sorted: bool,
        snapshot: &Snapshot,
        environment: &mut Environment,
        visit: &mut impl FnMut(&mut Environment) -> Result<Option<T>, E>,
    ) -> Result<Option<T>, E> {
        let Some(variable) = self.variables.get(index) else {
            return visit(environment);
        };
        let slot = self.first + index;
        let mut nodes = variable.nodes(slot, snapshot, environment)?;
        if sorted {
            let mut all = nodes.collect::<Result<Vec<_>, _>>()?;
            all.sort_unstable();
            nodes = Box::new(all.into_iter().map(Ok));
        }
        for id in nodes {
            environment[slot] = Slot::Node(id?);
            let found = self.descend(index + 1, sorted, snapshot, environment, visit)?;
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }
}

impl Variable {
    fn nodes<'a>(
        &'a self,
        slot: usize,
        snapshot: &'a Snapshot,
        environment: &Environment,
    ) -> Result<Nodes<'a>, ReadError> {
        let Some(link) = self.near else {
            return Ok(Box::new(self.domain.nodes(snapshot)));
        };
        let inwards = link.from == slot;
        let other = node(environment, if inwards { link.to } else { link.from });
        let other = other
            .map(|id| snapshot.find_node(id))
            .transpose()?
            .flatten();
        let (Some(other), Some(label)) = (other, link.label) else {
            return Ok(Box::new(std::iter::empty()));
        };
        let fits = |id: NodeId| {
            let found = snapshot.find_node(id)?;
            Ok(found
                .is_some_and(|found| self.domain.contains(found.type_id()))
                .then_some(id))
        };
        let near = move |end: fn(EdgeKey) -> NodeId| {
            move |key: Result<EdgeKey, ReadError>| key.and_then(|key| fits(end(key))).transpose()
        };
        Ok(if inwards {
            Box::new(other.in_edges_of(label).filter_map(near(|key| key.from)))
        } else {
            Box::new(other.out_edges_of(label).filter_map(near(|key| key.to)))
        })
    }
}

/// The links that must be there for the test to come out so.
fn needed(test: &Test, outcome: bool, links: &mut Vec<Link>) {
    match (test, outcome) {
        (Test::Link(link), outcome) if link.negated != outcome => links.push(*link),
        (Test::Not(inner), outcome) => needed(inner, !outcome, links),
        (Test::All(tests), true) | (Test::Any(tests), false) => {
            for inner in tests {
                needed(inner, outcome, links);
            }
        }
        _ => {}
    }
}
