//! Quantified variables: which nodes have to be looked at.
//!
//! Guarantee: no choice is left out at which the quantified formula could come out otherwise than
//! it does without it.

use super::candidates::{Candidate, Candidates};
use super::domain::Domain;
use super::environment::{Environment, Interrupt, node};
use super::host::Host;
use super::program::{Link, Slot, Test};
use dsr::ReadError;

/// Variables in neighbouring slots, and where their nodes are looked for.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Choices {
    first: usize,
    variables: Vec<Variable>,
}

#[derive(Debug, Clone, PartialEq)]
struct Variable {
    domain: Domain,
    /// Only nodes that this link joins to a node bound before can matter.
    near: Option<Link>,
}

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

    /// The same with other slots.
    pub(crate) fn moved(&self, to: &impl Fn(usize) -> usize) -> Self {
        let variable = |variable: &Variable| Variable {
            domain: variable.domain.clone(),
            near: variable.near.map(|link| link.moved(to)),
        };
        Self {
            first: to(self.first),
            variables: self.variables.iter().map(variable).collect(),
        }
    }

    /// The link that joins what a slot's node is to a node bound before, if only such nodes can
    /// matter.
    pub(crate) fn near(&self, slot: usize) -> Option<Link> {
        self.variables.get(slot.checked_sub(self.first)?)?.near
    }

    /// The slots of the variables, and what each ranges over.
    pub(crate) fn domains(&self) -> impl Iterator<Item = (usize, &Domain)> {
        (self.first..).zip(self.variables.iter().map(|variable| &variable.domain))
    }

    /// Puts every choice that matters into the slots, until `visit` gives something. The slots
    /// keep the choice that it gave something for.
    pub(crate) fn each<H: Host, T, E: From<Interrupt> + From<ReadError>>(
        &self,
        host: &H,
        environment: &mut Environment,
        visit: &mut impl FnMut(&mut Environment) -> Result<Option<T>, E>,
    ) -> Result<Option<T>, E> {
        self.descend(0, false, host, environment, visit)
    }

    /// The same, by ascending ids.
    pub(crate) fn each_in_order<H: Host, T, E: From<Interrupt> + From<ReadError>>(
        &self,
        host: &H,
        environment: &mut Environment,
        visit: &mut impl FnMut(&mut Environment) -> Result<Option<T>, E>,
    ) -> Result<Option<T>, E> {
        self.descend(0, true, host, environment, visit)
    }

    fn descend<H: Host, T, E: From<Interrupt> + From<ReadError>>(
        &self,
        index: usize,
        sorted: bool,
        host: &H,
        environment: &mut Environment,
        visit: &mut impl FnMut(&mut Environment) -> Result<Option<T>, E>,
    ) -> Result<Option<T>, E> {
        let Some(variable) = self.variables.get(index) else {
            return visit(environment);
        };
        let slot = self.first + index;
        let nodes = variable.nodes(slot, host, environment)?;
        let mut try_node = |candidate: Candidate| {
            environment.spend(1)?;
            let Candidate::Node(id, exact) = candidate else {
                return Ok(None);
            };
            if !variable.domain.contains(exact) {
                return Ok(None);
            }
            environment[slot] = Slot::Node(id);
            self.descend(index + 1, sorted, host, environment, visit)
        };
        if sorted {
            let mut all = nodes.collect::<Result<Vec<_>, _>>()?;
            all.sort_unstable();
            for candidate in all {
                let found = try_node(candidate)?;
                if found.is_some() {
                    return Ok(found);
                }
            }
            return Ok(None);
        }
        for candidate in nodes {
            let found = try_node(candidate?)?;
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }
}

impl Variable {
    /// Where its nodes are; not all of them need be of its domain where they are near a link.
    fn nodes<'h, H: Host>(
        &self,
        slot: usize,
        host: &'h H,
        environment: &Environment,
    ) -> Result<Candidates<'h, H>, ReadError> {
        let Some(link) = self.near else {
            return Ok(Candidates::members(host, self.domain.types()));
        };
        let inwards = link.from == slot;
        let other = node(environment, if inwards { link.to } else { link.from });
        let other = other.map(|other| host.find(other)).transpose()?.flatten();
        let (Some(other), Some(label)) = (other, link.label) else {
            return Ok(Candidates::Nothing);
        };
        Ok(Candidates::Ends(if inwards {
            host.sources(other, label)
        } else {
            host.targets(other, label)
        }))
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
