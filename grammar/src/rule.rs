//! The syntax tree of a rule: patterns, conditions, expressions, effects.
//!
//! Guarantee: equality ignores where things stand in the file, so a rule that was printed and read
//! again is equal to the one before.

use crate::Name;
use std::collections::BTreeMap;

/// Who brings a rule about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// Something acts on it: the planner may put it into a plan.
    Active,
    /// It describes what happens by itself; the planner never chooses it.
    Passive,
}

/// A pair of graphs: wherever the left one is found, it may be rewritten into the right one.
///
/// What a rule means, side by side:
/// - a node on both sides is kept (and retyped, if the right side gives it another type); only on
///   the left it is deleted with its links; only on the right it is created;
/// - a link on both sides is kept; only on the left it is deleted; only on the right it is created
///   unless it is there already;
/// - a starred (negated) link on the left must not be there; on the right it is deleted if it is
///   there, and never created.
#[derive(Debug, Clone, PartialEq)]
pub struct Rule {
    /// Unique in the grammar.
    pub name: Name,
    /// `active` or `passive`.
    pub kind: Kind,
    /// What applying it costs, without unit: a constant, or an expression over the left side.
    pub cost: Expression,
    /// How long carrying it out is expected to take, seconds.
    pub duration: Option<Expression>,
    /// The agent that carries it out.
    pub agent: Option<Name>,
    /// Probability that carrying it out succeeds, in [0, 1]; 1 where nothing is said.
    pub success: f64,
    /// Asleep until another rule `activates` it.
    pub dormant: bool,
    /// A summary of other rules that a planner may unfold.
    pub hierarchical: bool,
    /// Deleting a node is refused while it has links that the rule itself does not delete.
    pub strict: bool,
    /// Dormant rules that applying this one wakes.
    pub activates: Vec<Name>,
    /// What must be found.
    pub left: Pattern,
    /// What it becomes.
    pub right: Pattern,
    /// Nodes given by the caller besides those of the left side; matched like nodes of the left.
    pub parameters: Vec<PatternNode>,
    /// What must hold besides the left side.
    pub precondition: Option<Condition>,
    /// What changes besides the right side. Conditions and values in it are read in the graph
    /// before the rule; deletions come before creations.
    pub effect: Vec<Effect>,
    /// Comment lines before and inside the rule, without `#`.
    pub comments: Vec<String>,
}

impl Rule {
    /// The nodes that a match of this rule binds: those of the left side in the order they are
    /// written, then parameters that are not among them.
    pub fn bound_nodes(&self) -> impl Iterator<Item = &PatternNode> {
        let extra = self
            .parameters
            .iter()
            .filter(|parameter| self.left.node(&parameter.variable).is_none());
        self.left.nodes.iter().chain(extra)
    }
}

/// Typed nodes and the links between them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Pattern {
    /// In the order written; variables are distinct.
    pub nodes: Vec<PatternNode>,
    /// In the order written.
    pub edges: Vec<PatternEdge>,
}

impl Pattern {
    /// The node with this variable.
    pub fn node(&self, variable: &str) -> Option<&PatternNode> {
        self.nodes.iter().find(|node| node.variable == *variable)
    }

    /// The link `from -> to (label)`, negated or not.
    pub fn edge(&self, from: &str, label: &str, to: &str) -> Option<&PatternEdge> {
        self.edges.iter().find(|edge| edge.joins(from, label, to))
    }

    /// To look up more than one of its nodes or links.
    pub(crate) fn index(&self) -> PatternIndex<'_> {
        let mut index = PatternIndex::default();
        for node in &self.nodes {
            index.nodes.entry(&node.variable).or_insert(node);
        }
        for edge in &self.edges {
            let key = (&*edge.from, &*edge.label, &*edge.to);
            index.edges.entry(key).or_insert(edge);
        }
        index
    }
}

/// The nodes and links of a pattern by their names.
#[derive(Debug, Default)]
pub(crate) struct PatternIndex<'p> {
    nodes: BTreeMap<&'p str, &'p PatternNode>,
    edges: BTreeMap<(&'p str, &'p str, &'p str), &'p PatternEdge>,
}

impl<'p> PatternIndex<'p> {
    /// As [`Pattern::node`].
    pub(crate) fn node(&self, variable: &str) -> Option<&'p PatternNode> {
        self.nodes.get(variable).copied()
    }

    /// As [`Pattern::edge`].
    pub(crate) fn edge(&self, from: &str, label: &str, to: &str) -> Option<&'p PatternEdge> {
        self.edges.get(&(from, label, to)).copied()
    }
}

/// `variable:type`, with the place where an editor draws it.
#[derive(Debug, Clone, PartialEq)]
pub struct PatternNode {
    /// The variable; in a goal also a constant (see [`crate::Goal`]).
    pub variable: Name,
    /// A node matches if its type is this one or inherits from it.
    pub type_name: Name,
    /// Where a graphical editor draws the node, pixels; means nothing.
    pub position: Option<[f64; 2]>,
}

impl PatternNode {
    /// `variable:type_name`, drawn nowhere.
    pub fn new(variable: impl Into<Name>, type_name: impl Into<Name>) -> Self {
        Self {
            variable: variable.into(),
            type_name: type_name.into(),
            position: None,
        }
    }
}

/// `from->to(label)`, or with a star: that link must not be there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PatternEdge {
    /// Variable of the node it leaves.
    pub from: Name,
    /// Label.
    pub label: Name,
    /// Variable of the node it enters.
    pub to: Name,
    /// True with a star.
    pub negated: bool,
}

impl PatternEdge {
    /// Whether it is the link `from -> to (label)`, negated or not.
    pub fn joins(&self, from: &str, label: &str, to: &str) -> bool {
        self.from == *from && self.label == *label && self.to == *to
    }
}

/// A formula that holds or not at a binding.
///
/// It has two values: a comparison whose attribute is missing or cannot be compared does not
/// hold. Quantified variables range over every node of their type, bound ones included.
#[derive(Debug, Clone, PartialEq)]
pub enum Condition {
    /// `(label from to)`: the link is there.
    Edge {
        /// Label.
        label: Name,
        /// Variable of the node it leaves.
        from: Name,
        /// Variable of the node it enters.
        to: Name,
    },
    /// `(= a b)` of two variables: they stand for the same node. `(eq a b)` reads the same.
    Same(Name, Name),
    /// `(<= x y)` and its kin, on values.
    Compare {
        /// Which comparison.
        operator: Comparison,
        /// Left operand.
        left: Box<Expression>,
        /// Right operand.
        right: Box<Expression>,
    },
    /// `(not F)`.
    Not(Box<Condition>),
    /// `(and F ...)`; holds when empty.
    And(Vec<Condition>),
    /// `(or F ...)`; does not hold when empty.
    Or(Vec<Condition>),
    /// `(exists v:t ... F)`.
    Exists {
        /// Bound in the body.
        variables: Vec<PatternNode>,
        /// Must hold for one choice of the variables.
        body: Box<Condition>,
    },
    /// `(forall v:t ... F)`.
    Forall {
        /// Bound in the body.
        variables: Vec<PatternNode>,
        /// Must hold for every choice of the variables.
        body: Box<Condition>,
    },
    /// `(when F G)`: if `F` holds, so must `G`.
    When {
        /// If this holds,
        condition: Box<Condition>,
        /// so must this.
        consequence: Box<Condition>,
    },
}

/// A comparison of two values. Order is defined on numbers only, equality on values of any kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Comparison {
    /// `=`
    Equal,
    /// `!=`
    NotEqual,
    /// `<`
    Less,
    /// `<=`
    LessOrEqual,
    /// `>`
    Greater,
    /// `>=`
    GreaterOrEqual,
}

impl Comparison {
    /// As it is written.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Equal => "=",
            Self::NotEqual => "!=",
            Self::Less => "<",
            Self::LessOrEqual => "<=",
            Self::Greater => ">",
            Self::GreaterOrEqual => ">=",
        }
    }

    /// The comparison that holds of two values with an order where this one does not.
    #[must_use]
    pub const fn negated(self) -> Self {
        match self {
            Self::Equal => Self::NotEqual,
            Self::NotEqual => Self::Equal,
            Self::Less => Self::GreaterOrEqual,
            Self::LessOrEqual => Self::Greater,
            Self::Greater => Self::LessOrEqual,
            Self::GreaterOrEqual => Self::Less,
        }
    }
}

/// A value computed at a binding.
#[derive(Debug, Clone, PartialEq)]
pub enum Expression {
    /// A constant.
    Literal(Literal),
    /// The value of an attribute.
    Attribute(AttributePath),
    /// `(+ a b ...)` and its kin. `(- a)` negates; `-` and `/` take the later operands from the
    /// first, one after another. `/` is always real.
    Arithmetic {
        /// Which operation.
        operator: Arithmetic,
        /// At least one for `-`, at least two for the others.
        operands: Vec<Expression>,
    },
}

impl Expression {
    /// The constant real number `value`.
    pub fn number(value: f64) -> Self {
        Self::Literal(Literal::Real(value))
    }

    /// The number, if this is a constant one.
    pub fn as_number(&self) -> Option<f64> {
        match self {
            Self::Literal(Literal::Integer(value)) => Some(*value as f64),
            Self::Literal(Literal::Large(value)) => Some(*value as f64),
            Self::Literal(Literal::Real(value)) => Some(*value),
            _ => None,
        }
    }
}

/// A constant value.
#[derive(Debug, Clone, PartialEq)]
pub enum Literal {
    /// Digits without point or exponent.
    Integer(i64),
    /// The same, beyond the largest `i64`.
    Large(u64),
    /// Digits with point or exponent; always finite.
    Real(f64),
    /// Text in quotes.
    Text(String),
    /// `true` or `false`.
    Boolean(bool),
}

impl Literal {
    /// A number as it is written; `None` where it is whole and beyond what any value can be.
    pub(crate) fn number(text: &str) -> Option<Self> {
        let whole = text
            .bytes()
            .all(|byte| byte.is_ascii_digit() || byte == b'-');
        if !whole {
            return text.parse().ok().map(Self::Real);
        }
        let small = text.parse().map(Self::Integer);
        small.or_else(|_| text.parse().map(Self::Large)).ok()
    }

    /// The value.
    pub fn value(&self) -> dsr::Value {
        match self {
            Self::Integer(value) => (*value).into(),
            Self::Large(value) => (*value).into(),
            Self::Real(value) => (*value).into(),
            Self::Text(text) => text.as_str().into(),
            Self::Boolean(value) => (*value).into(),
        }
    }
}

/// An arithmetic operation on numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Arithmetic {
    /// `+`
    Add,
    /// `-`
    Subtract,
    /// `*`
    Multiply,
    /// `/`
    Divide,
}

impl Arithmetic {
    /// As it is written.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Add => "+",
            Self::Subtract => "-",
            Self::Multiply => "*",
            Self::Divide => "/",
        }
    }
}

/// `x.attribute` or `e(a, label, b).attribute`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AttributePath {
    /// Of a node.
    Node {
        /// The node's variable.
        variable: Name,
        /// The attribute's name.
        attribute: Name,
    },
    /// Of a link.
    Edge {
        /// Variable of the node it leaves.
        from: Name,
        /// Label.
        label: Name,
        /// Variable of the node it enters.
        to: Name,
        /// The attribute's name.
        attribute: Name,
    },
}

/// One thing that an effect block changes. `(and E ...)` is simply several effects.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// `(label from to)`: the link is there afterwards.
    Link {
        /// Label.
        label: Name,
        /// Variable of the node it leaves.
        from: Name,
        /// Variable of the node it enters.
        to: Name,
    },
    /// `(not (label from to))`: the link is not there afterwards.
    Unlink {
        /// Label.
        label: Name,
        /// Variable of the node it leaves.
        from: Name,
        /// Variable of the node it enters.
        to: Name,
    },
    /// `(assign x.attribute value)`.
    Assign {
        /// Attribute written.
        target: AttributePath,
        /// Value, computed before the rule changes anything.
        value: Expression,
    },
    /// `(create v t)`: a new node, which effects after it in the same list may use.
    Create {
        /// Variable of the new node.
        variable: Name,
        /// Its type.
        type_name: Name,
    },
    /// `(delete v)`: the node goes, with its links.
    Delete {
        /// Variable of the node.
        variable: Name,
    },
    /// `(retype v t)`.
    Retype {
        /// Variable of the node.
        variable: Name,
        /// Its new type.
        type_name: Name,
    },
    /// `(forall v:t ... E)`: the effects happen for every choice of the variables.
    Forall {
        /// Bound in the body.
        variables: Vec<PatternNode>,
        /// What happens.
        body: Vec<Effect>,
    },
    /// `(when F E)`: the effects happen if `F` holds before the rule.
    When {
        /// If this holds,
        condition: Condition,
        /// this happens.
        body: Vec<Effect>,
    },
}
