//! Rules and goals with numbers for names: what grounding, simulation and explanation work on.
//! This file owns the meaning of a rule's parts as the planner sees them; `compile` makes them.

use super::vocabulary::{TypeSet, Vocabulary};
use dsr::Value;
use grammar::{Arithmetic, Comparison};

/// An object of the world, by number.
pub(crate) type Object = u32;

/// A slot that is not bound.
pub(crate) const UNBOUND: Object = Object::MAX;

/// Which object each slot stands for.
pub(crate) type Environment = Vec<Object>;

/// A link between slots, or between objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Link {
    pub(crate) label: u16,
    pub(crate) from: u32,
    pub(crate) to: u32,
}

impl Link {
    /// The link of objects that this link of slots stands for.
    pub(crate) fn at(self, environment: &[Object]) -> Self {
        Self {
            label: self.label,
            from: environment[self.from as usize],
            to: environment[self.to as usize],
        }
    }
}

/// What carries an attribute, of slots or of objects, and which attribute.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Place {
    Node(u32, u16),
    Link(Link, u16),
}

impl Place {
    /// The place of objects that this place of slots stands for.
    pub(crate) fn at(self, environment: &[Object]) -> Self {
        match self {
            Self::Node(slot, attribute) => Self::Node(environment[slot as usize], attribute),
            Self::Link(link, attribute) => Self::Link(link.at(environment), attribute),
        }
    }

    pub(crate) fn attribute(self) -> u16 {
        match self {
            Self::Node(_, attribute) | Self::Link(_, attribute) => attribute,
        }
    }
}

/// A value computed at a binding.
#[derive(Debug, Clone)]
pub(crate) enum Term {
    Constant(Value),
    Place(Place),
    Arithmetic(Arithmetic, Vec<Term>),
}

impl Term {
    /// Calls `visit` with each place in it.
    pub(crate) fn each_place(&self, visit: &mut impl FnMut(Place)) {
        match self {
            Self::Constant(_) => {}
            Self::Place(place) => visit(*place),
            Self::Arithmetic(_, operands) => operands.iter().for_each(|o| o.each_place(visit)),
        }
    }
}

/// A condition.
#[derive(Debug, Clone)]
pub(crate) enum Test {
    Link(Link),
    Same(u32, u32),
    Compare(Comparison, Term, Term),
    Not(Box<Test>),
    All(Vec<Test>),
    Any(Vec<Test>),
    /// Slots from `first` on take every choice from the domains.
    Exists(Quantified<Box<Test>>),
    Forall(Quantified<Box<Test>>),
}

/// Slots from `first` on take every choice of objects of these types.
#[derive(Debug, Clone)]
pub(crate) struct Quantified<T> {
    pub(crate) first: usize,
    pub(crate) domains: Vec<TypeSet>,
    pub(crate) body: T,
}

/// One thing that a rule changes.
#[derive(Debug, Clone)]
pub(crate) enum Change {
    Link(Link),
    Unlink(Link),
    Assign(Place, Term),
    Create(u32, u16),
    Delete(u32),
    Retype(u32, u16),
    Forall(Quantified<Vec<Change>>),
    When(Test, Vec<Change>),
}

/// A variable of a rule or goal.
#[derive(Debug, Clone)]
pub(crate) struct Variable {
    pub(crate) name: String,
    /// Exact types that it may stand for; for a created one its only type.
    pub(crate) types: TypeSet,
}

/// A rule, or a goal (which changes nothing).
#[derive(Debug, Clone)]
pub(crate) struct Operator {
    /// The rule's name; empty for a goal.
    pub(crate) name: String,
    /// Bound variables, then created ones.
    pub(crate) variables: Vec<Variable>,
    /// How many are bound.
    pub(crate) bound: usize,
    /// Objects that slots stand for whatever happens: a goal's constants.
    pub(crate) fixed: Vec<(usize, Object)>,
    /// How many slots its quantifiers take at the most, variables included.
    pub(crate) slots: usize,
    /// Links that must be there.
    pub(crate) links: Vec<Link>,
    /// Links that must not be there.
    pub(crate) absent: Vec<Link>,
    /// What must hold besides.
    pub(crate) tests: Vec<Test>,
    pub(crate) changes: Vec<Change>,
    pub(crate) cost: Term,
    pub(crate) success: f64,
    pub(crate) agent: Option<String>,
    /// Asleep until another rule wakes it.
    pub(crate) dormant: bool,
    /// Operators that it wakes.
    pub(crate) wakes: Vec<usize>,
    /// Refuses to leave links hanging.
    pub(crate) strict: bool,
}

impl Operator {
    /// Whether it creates nodes.
    pub(crate) fn creates(&self) -> bool {
        self.bound < self.variables.len()
    }

    /// Whether links that it does not take away may keep it from deleting a node.
    pub(crate) fn is_held_by_links(&self) -> bool {
        let mut deletes = false;
        self.each_change(&mut |change| deletes |= matches!(change, Change::Delete(_)));
        self.strict && deletes
    }

    /// An environment with the constants in place.
    pub(crate) fn environment(&self) -> Environment {
        let mut environment = vec![UNBOUND; self.slots];
        for &(slot, object) in &self.fixed {
            environment[slot] = object;
        }
        environment
    }

    /// Calls `visit` with each change, also those under conditions.
    pub(crate) fn each_change(&self, visit: &mut impl FnMut(&Change)) {
        fn walk(changes: &[Change], visit: &mut impl FnMut(&Change)) {
            for change in changes {
                visit(change);
                match change {
                    Change::Forall(quantified) => walk(&quantified.body, visit),
                    Change::When(_, body) => walk(body, visit),
                    _ => {}
                }
            }
        }
        walk(&self.changes, visit);
    }
}

/// A grammar, compiled.
#[derive(Debug, Clone)]
pub(crate) struct Program {
    pub(crate) vocabulary: Vocabulary,
    /// Rules that a plan may use.
    pub(crate) operators: Vec<Operator>,
    /// Exact types that any variable may stand for.
    pub(crate) types: TypeSet,
    /// Labels that some rule may make: not only where they are already.
    pub(crate) made: Vec<bool>,
    /// Labels that some rule may remove.
    pub(crate) removed: Vec<bool>,
    /// Whether a rule creates, deletes or retypes nodes.
    pub(crate) types_change: bool,
    /// Whether a rule refuses to delete nodes that have links.
    pub(crate) strict: bool,
    /// Attributes that rules assign and conditions, costs or assigned values read.
    pub(crate) assigned: Vec<bool>,
    /// Rules that no plan can use, and why.
    pub(crate) notes: Vec<String>,
}
