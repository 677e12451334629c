//! The part of a snapshot that a grammar and a goal can speak of. This file guarantees that the
//! snapshot is read once and in the order of its ids, and nothing of it afterwards.

use super::facts::Facts;
use super::program::{Link, Object, Operator, Place, Program, Term, Test};
use dsr::{EdgeKey, NodeId, ReadError, Snapshot, Value};
use rustc_hash::{FxHashMap, FxHasher};
use std::hash::{Hash, Hasher};

/// Nodes, links and values of a snapshot.
#[derive(Debug, Clone)]
pub(crate) struct World {
    /// The nodes, by object number.
    pub(crate) nodes: Vec<NodeId>,
    pub(crate) names: Vec<String>,
    objects: FxHashMap<NodeId, Object>,
    pub(crate) facts: Facts,
    /// Changes whenever anything in here does.
    pub(crate) fingerprint: u64,
}

/// The attributes that a program and a goal read, of nodes and of links.
fn attributes_read(program: &Program, goal: &Operator) -> Vec<Place> {
    fn in_test(test: &Test, visit: &mut impl FnMut(Place)) {
        match test {
            Test::Link(_) | Test::Same(..) => {}
            Test::Compare(_, left, right) => {
                left.each_place(visit);
                right.each_place(visit);
            }
            Test::Not(inner) => in_test(inner, visit),
            Test::All(parts) | Test::Any(parts) => parts.iter().for_each(|p| in_test(p, visit)),
            Test::Exists(quantified) | Test::Forall(quantified) => in_test(&quantified.body, visit),
        }
    }
    use super::program::Change;
    let mut places = Vec::new();
    let mut visit = |place| places.push(place);
    for operator in program.operators.iter().chain([goal]) {
        operator.tests.iter().for_each(|t| in_test(t, &mut visit));
        Term::each_place(&operator.cost, &mut visit);
        operator.each_change(&mut |change| match change {
            Change::Assign(_, term) => term.each_place(&mut visit),
            Change::When(test, _) => in_test(test, &mut visit),
            _ => {}
        });
    }
    places
}

impl World {
    /// Reads what `program` and `goal` can speak of.
    pub(crate) fn read(
        snapshot: &Snapshot,
        program: &Program,
        goal: &Operator,
    ) -> Result<Self, ReadError> {
        let vocabulary = &program.vocabulary;
        let schema = snapshot.schema();
        let mut found: Vec<(NodeId, u16)> = Vec::new();
        for exact in program.types.ones() {
            let name = vocabulary.types.name(exact as u16);
            let Some(type_id) = schema.find_type(name) else {
                continue;
            };
            for node in snapshot.nodes_of_type(type_id) {
                let node = node?;
                // Each node once, by its exact type.
                if node.type_id() == type_id {
                    found.push((node.id(), exact as u16));
                }
            }
        }
        found.sort_unstable();
        let mut world = Self {
            nodes: found.iter().map(|&(id, _)| id).collect(),
            names: Vec::new(),
            objects: (0..).zip(&found).map(|(o, &(id, _))| (id, o)).collect(),
            facts: Facts::new(vocabulary.labels.len(), vocabulary.types.len(), found.len()),
            fingerprint: 0,
        };
        let mut hasher = FxHasher::default();
        for (object, &(id, exact)) in (0..).zip(&found) {
            let node = snapshot.find_node(id)?;
            let name = node.map_or(Ok(String::new()), |node| node.name())?;
            (id, exact, &name).hash(&mut hasher);
            world.names.push(name);
            world.facts.add_type(object, exact);
        }
        // What hangs on nodes that no rule speaks of keeps a strict rule from deleting: they all are one
        // object here, which nothing can be bound to.
        let elsewhere = program.strict.then(|| {
            world.names.push("elsewhere".to_owned());
            world.facts.add_object()
        });
        for (label, name) in vocabulary.labels.iter() {
            let Some(label_id) = schema.find_label(name) else {
                continue;
            };
            for key in snapshot.edges_of_label(label_id) {
                let key = key?;
                let (from, to) = (world.object(key.from), world.object(key.to));
                if from.is_none() && to.is_none() {
                    continue;
                }
                if let (Some(from), Some(to)) = (from.or(elsewhere), to.or(elsewhere)) {
                    (label, from, to).hash(&mut hasher);
                    world.facts.add_link(Link { label, from, to });
                }
            }
        }
        world.read_values(snapshot, program, goal, &mut hasher)?;
        world.fingerprint = hasher.finish();
        Ok(world)
    }

    fn read_values(
        &mut self,
        snapshot: &Snapshot,
        program: &Program,
        goal: &Operator,
        hasher: &mut FxHasher,
    ) -> Result<(), ReadError> {
        let schema = snapshot.schema();
        let (mut of_nodes, mut of_links) = (Vec::new(), Vec::new());
        for place in attributes_read(program, goal) {
            let attribute = place.attribute();
            let name = program.vocabulary.attributes.name(attribute);
            let Some(id) = schema.find_attribute(name) else {
                continue;
            };
            match place {
                Place::Node(..) => of_nodes.push((attribute, id)),
                Place::Link(link, _) => of_links.push((link.label, attribute, id)),
            }
        }
        of_nodes.sort_unstable();
        of_nodes.dedup();
        of_links.sort_unstable();
        of_links.dedup();
        let mut put = |facts: &mut Facts, place: Place, value: Value| {
            (place, format!("{value:?}")).hash(hasher);
            facts.set_value(place, Some(value));
        };
        for (object, &id) in (0..).zip(&self.nodes) {
            let Some(node) = snapshot.find_node(id)? else {
                continue;
            };
            for &(attribute, name) in &of_nodes {
                if let Some(found) = node.attribute(name)? {
                    put(&mut self.facts, Place::Node(object, attribute), found.value);
                }
            }
        }
        for &(label, attribute, name) in &of_links {
            let label_name = program.vocabulary.labels.name(label);
            let Some(label_id) = schema.find_label(label_name) else {
                continue;
            };
            for (from, to) in self.facts.pairs(label).to_vec() {
                let nodes = [from, to].map(|object| self.nodes.get(object as usize));
                let [Some(&from_node), Some(&to_node)] = nodes else {
                    continue;
                };
                let key = EdgeKey {
                    from: from_node,
                    label: label_id,
                    to: to_node,
                };
                let Some(edge) = snapshot.find_edge(key)? else {
                    continue;
                };
                if let Some(found) = edge.attribute(name)? {
                    let link = Link { label, from, to };
                    put(&mut self.facts, Place::Link(link, attribute), found.value);
                }
            }
        }
        Ok(())
    }

    /// The object that stands for a node.
    pub(crate) fn object(&self, node: NodeId) -> Option<Object> {
        self.objects.get(&node).copied()
    }

    /// The object of that name.
    pub(crate) fn object_named(&self, name: &str) -> Option<Object> {
        let index = self.names.iter().position(|known| known == name);
        index.map(|index| index as Object)
    }
}
