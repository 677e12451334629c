//! Searches of several patterns from the same nodes, made together where they begin with the same steps.
//!
//! Guarantee: each pattern has the matches that a search of its own finds; what several begin with, whatever their
//! variables are called, is done once.

use super::super::ahead::Ahead;
use super::super::domain::Domain;
use super::super::environment::{Environment, Interrupt, SEARCH_LIMIT};
use super::super::frame::Frame;
use super::super::host::{Host, Way};
use super::super::plan::{Plan, Source, Step};
use super::super::program::{Link, Slot, Test};
use super::super::query::Query;
use super::set::Row;
use dsr::{AttributeId, LabelId, NodeId, ValueRange};
use std::sync::Arc;

/// Quantified variables have places from here on.
const QUANTIFIED: usize = 1 << 32;

/// A pattern, some of whose slots are given.
#[derive(Debug)]
pub(super) struct Member {
    pub(super) pattern: usize,
    pub(super) query: Arc<Query>,
    pub(super) plan: Arc<Plan>,
    /// The slots in the order in which they are bound: the given ones first, in the order of the nodes given.
    order: Vec<usize>,
    /// By slot, its place in that order.
    places: Vec<usize>,
}

/// A part of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// Whether the given nodes fit.
    Given,
    /// What a step finds, and whether its links are there.
    Step(usize),
    /// The conditions after a step, or on what is given.
    Tests(Option<usize>),
}

/// What makes parts of searches the same, slots being places.
#[derive(Debug, PartialEq)]
enum Key {
    Given(Vec<Domain>, Vec<Link>),
    Step {
        source: From,
        label: Option<LabelId>,
        domains: Vec<Domain>,
        others: [Vec<usize>; 2],
        links: Vec<Link>,
    },
    Tests(Vec<Test>),
}

#[derive(Debug, PartialEq)]
enum From {
    Nodes,
    Edges,
    Along(Way, usize),
    Values(AttributeId, ValueRange),
}

/// A part of one or more searches, and those that go on from it.
#[derive(Debug)]
pub(super) struct Branch {
    pub(super) part: Part,
    /// The members whose search it is part of; it goes by the first's slots.
    pub(super) through: Vec<usize>,
    next: Vec<usize>,
    /// The members whose search ends with it.
    done: Vec<usize>,
    depth: usize,
}

/// Patterns that are searched for from the same nodes.
#[derive(Debug, Default)]
pub(super) struct Shared {
    pub(super) members: Vec<Member>,
    pub(super) branches: Vec<Branch>,
    roots: Vec<usize>,
    /// Members that have no step in common with another.
    pub(super) alone: Vec<usize>,
    /// By member, what its variables stand for; by depth, what was read of a step's candidates: kept only to be
    /// filled again.
    environments: Vec<Environment>,
    ahead: Vec<Ahead>,
}

impl Member {
    /// `given` are its slots for the nodes that are given, in their order.
    pub(super) fn new(pattern: usize, query: Arc<Query>, plan: Arc<Plan>, given: &[usize]) -> Self {
        let steps = plan.steps.iter();
        let bound = steps.flat_map(|step| step.binds.into_iter().flatten());
        let order: Vec<usize> = given.iter().copied().chain(bound).collect();
        let mut places = vec![0; query.variables.len()];
        for (place, &slot) in order.iter().enumerate() {
            places[slot] = place;
        }
        Self {
            pattern,
            query,
            plan,
            order,
            places,
        }
    }

    /// Its slots for the nodes that are given.
    pub(super) fn given(&self) -> &[usize] {
        &self.order[..self.plan.given.len()]
    }

    fn place(&self, slot: usize) -> usize {
        let known = self.places.get(slot).copied();
        known.unwrap_or_else(|| QUANTIFIED + slot - self.places.len())
    }

    fn parts(&self) -> Vec<Part> {
        let mut parts = vec![Part::Given];
        if !self.plan.tests.is_empty() {
            parts.push(Part::Tests(None));
        }
        for (index, step) in self.plan.steps.iter().enumerate() {
            parts.push(Part::Step(index));
            if !step.tests.is_empty() {
                parts.push(Part::Tests(Some(index)));
            }
        }
        parts
    }

    fn key(&self, part: Part) -> Key {
        let links = |links: &mut dyn Iterator<Item = usize>| {
            let moved = links.map(|link| self.query.links[link].moved(&|slot| self.place(slot)));
            let mut moved: Vec<Link> = moved.collect();
            moved.sort_by_key(|link| (link.label, link.from, link.to, link.negated));
            moved
        };
        let domain = |slot: usize| self.query.domains[slot].clone();
        match part {
            Part::Given => {
                let domains = self.given().iter().map(|&slot| domain(slot)).collect();
                Key::Given(domains, links(&mut self.plan.links.iter().copied()))
            }
            Part::Tests(after) => {
                let tests = self.tests(after).iter();
                let moved = |&test: &usize| self.query.tests[test].moved(&|slot| self.place(slot));
                Key::Tests(tests.map(moved).collect())
            }
            Part::Step(index) => {
                let step = &self.plan.steps[index];
                let binds = step.binds.into_iter().flatten();
                let others = step.others.each_ref().map(|others| {
                    let mut places: Vec<usize> = others.iter().map(|&o| self.place(o)).collect();
                    places.sort_unstable();
                    places
                });
                Key::Step {
                    source: self.source(step),
                    label: step.label,
                    domains: binds.map(domain).collect(),
                    others,
                    links: links(&mut step.links.iter().map(|(link, _)| *link)),
                }
            }
        }
    }

    fn source(&self, step: &Step) -> From {
        let link = |link: usize| self.query.links[link];
        match step.source {
            Source::Nodes { .. } => From::Nodes,
            Source::Edges { .. } => From::Edges,
            Source::Out { link: index } => From::Along(Way::Out, self.place(link(index).from)),
            Source::In { link: index } => From::Along(Way::In, self.place(link(index).to)),
            Source::Values { bound } => {
                let bound = &self.query.bounds[bound];
                From::Values(bound.attribute, bound.range.clone())
            }
        }
    }

    fn tests(&self, after: Option<usize>) -> &[usize] {
        match after {
            Some(step) => &self.plan.steps[step].tests,
            None => &self.plan.tests,
        }
    }

    fn row(&self, bound: &[NodeId]) -> Row {
        self.places.iter().map(|&place| bound[place]).collect()
    }
}

impl Shared {
    pub(super) fn new(members: Vec<Member>) -> Self {
        let mut shared = Self {
            members,
            ..Self::default()
        };
        let mut keys: Vec<Key> = Vec::new();
        for index in 0..shared.members.len() {
            let mut above: Option<usize> = None;
            for part in shared.members[index].parts() {
                let key = shared.members[index].key(part);
                let (next, depth) = match above {
                    Some(above) => (
                        &shared.branches[above].next,
                        shared.branches[above].depth + 1,
                    ),
                    None => (&shared.roots, 0),
                };
                let known = next.iter().copied().find(|&branch| keys[branch] == key);
                let branch = known.unwrap_or(keys.len());
                if known.is_none() {
                    keys.push(key);
                    shared.branches.push(Branch {
                        part,
                        through: Vec::new(),
                        next: Vec::new(),
                        done: Vec::new(),
                        depth,
                    });
                    match above {
                        Some(above) => shared.branches[above].next.push(branch),
                        None => shared.roots.push(branch),
                    }
                }
                shared.branches[branch].through.push(index);
                above = Some(branch);
            }
            if let Some(last) = above {
                shared.branches[last].done.push(index);
            }
        }
        let mut alone = vec![true; shared.members.len()];
        for branch in &shared.branches {
            if matches!(branch.part, Part::Step(_)) && branch.through.len() > 1 {
                for &member in &branch.through {
                    alone[member] = false;
                }
            }
        }
        shared.alone = (0..alone.len()).filter(|&member| alone[member]).collect();
        shared
    }

    /// Whether it was made for these plans.
    pub(super) fn goes_by(&self, plans: &[Arc<Plan>]) -> bool {
        let members = self.members.iter().zip(plans);
        members
            .into_iter()
            .all(|(member, plan)| Arc::ptr_eq(&member.plan, plan))
    }

    /// The branches that go on from one, conditions that stand between them left out.
    pub(super) fn after(&self, branch: usize) -> impl Iterator<Item = usize> {
        let next = &self.branches[branch].next;
        next.iter()
            .flat_map(|&next| match self.branches[next].part {
                Part::Tests(_) => self.branches[next].next.clone(),
                _ => vec![next],
            })
    }

    /// The matches of all members that are not alone, from these nodes.
    pub(super) fn search<H: Host>(
        &mut self,
        host: &H,
        given: &[NodeId],
        found: &mut impl FnMut(usize, Row),
    ) -> Result<(), Interrupt> {
        let mut environments = std::mem::take(&mut self.environments);
        let mut ahead = std::mem::take(&mut self.ahead);
        if environments.is_empty() {
            let fresh = |member: &Member| Environment::new(member.query.slots, SEARCH_LIMIT);
            environments.extend(self.members.iter().map(fresh));
            ahead.resize(self.branches.len(), Ahead::default());
        }
        environments.iter_mut().for_each(Environment::renew);
        let mut run = Run {
            shared: self,
            host,
            bound: given.to_vec(),
            environments,
            ahead,
            found,
        };
        for &root in &self.roots {
            run.enter(root)?;
        }
        let Run {
            environments,
            ahead,
            ..
        } = run;
        (self.environments, self.ahead) = (environments, ahead);
        Ok(())
    }
}

/// A search under way.
struct Run<'r, 'h, H: Host, F> {
    shared: &'r Shared,
    host: &'h H,
    /// The nodes that are bound, by place.
    bound: Vec<NodeId>,
    /// By member, as far as it went first on a branch.
    environments: Vec<Environment>,
    /// By depth, what was read of a step's candidates.
    ahead: Vec<Ahead>,
    found: &'r mut F,
}

impl<'r, H: Host, F: FnMut(usize, Row)> Run<'r, '_, H, F> {
    fn enter(&mut self, index: usize) -> Result<(), Interrupt> {
        let shared: &'r Shared = self.shared;
        let branch = &shared.branches[index];
        if let [only] = branch.through[..]
            && shared.alone.contains(&only)
        {
            return Ok(());
        }
        let by = branch.through[0];
        let member = &shared.members[by];
        for (&slot, &node) in member.order.iter().zip(&self.bound) {
            self.environments[by][slot] = Slot::Node(node);
        }
        let frame = Frame {
            host: self.host,
            query: &member.query,
            plan: &member.plan,
        };
        match branch.part {
            Part::Given => {
                if frame.given_fits(&self.environments[by])? {
                    self.go_on(branch)?;
                }
            }
            Part::Tests(after) => {
                if frame.tests_hold(member.tests(after), &mut self.environments[by])? {
                    self.go_on(branch)?;
                }
            }
            Part::Step(step) => {
                let step = &member.plan.steps[step];
                let mut other = frame.open(step);
                self.ahead[branch.depth].begin();
                loop {
                    if let Some(ends) = self.ahead[branch.depth].next() {
                        let environment = &mut self.environments[by];
                        step.bind(ends, environment);
                        if frame.links_hold(step, &[], environment)? {
                            let bound = self.bound.len();
                            let binds = step.binds.into_iter().zip(ends);
                            let nodes = binds.filter_map(|(slot, node)| slot.map(|_| node));
                            self.bound.extend(nodes);
                            self.go_on(branch)?;
                            self.bound.truncate(bound);
                        }
                    } else if let Some((from, rows)) = self.ahead[branch.depth].read_on() {
                        let environment = &mut self.environments[by];
                        let anchor = step.anchors.first().filter(|_| step.follows());
                        let edges = anchor.map(|anchor| frame.edges(*anchor, environment));
                        let edges = edges.transpose()?.flatten();
                        let (_, more) =
                            frame.read(step, edges, from, &mut other, (rows, environment))?;
                        self.ahead[branch.depth].stopped_at(more);
                    } else {
                        break;
                    }
                }
            }
        }
        Ok(())
    }

    fn go_on(&mut self, branch: &'r Branch) -> Result<(), Interrupt> {
        for &done in &branch.done {
            let member = &self.shared.members[done];
            (self.found)(member.pattern, member.row(&self.bound));
            for environment in &mut self.environments {
                environment.renew();
            }
        }
        for &next in &branch.next {
            self.enter(next)?;
        }
        Ok(())
    }
}
