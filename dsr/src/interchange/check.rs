//! What looks wrong with a graph as a whole: its kinematic trees, and names that lead nowhere.

use super::{Problem, Severity};
use crate::{Node, NodeId, ReadError, Snapshot, TransformError, Value};
use std::collections::{BTreeMap, BTreeSet};

/// What is wrong with the poses of a graph: circles, nodes that hang on two others, poses that cannot be
/// read are errors; trees that nothing connects, a `parent` (as RoboComp writes it) that is not there and an `RT`
/// without attributes (as symbolic models have it) are warnings.
///
/// # Errors
/// [`ReadError`].
pub fn check_graph(snapshot: &Snapshot) -> Result<Vec<Problem>, ReadError> {
    let mut problems = Vec::new();
    let mut told = |severity, message| problems.push(Problem::of_graph(severity, message));
    let mut nodes = snapshot.nodes().collect::<Result<Vec<_>, _>>()?;
    nodes.sort_by_key(Node::id);
    let mut parents: BTreeMap<NodeId, NodeId> = BTreeMap::new();
    for node in &nodes {
        match snapshot.parent_pose(node.id()) {
            Ok(None) => {}
            Ok(Some(edge)) => {
                parents.insert(node.id(), edge.key().from);
                match snapshot.pose_of(&edge) {
                    Err(TransformError::Read(error)) => return Err(error),
                    Err(refused) => {
                        // A symbolic model of AGM has links `RT` that say no more than which parent.
                        let symbolic = edge.attributes()?.is_empty()
                            && snapshot.schema().label_name(edge.key().label) == "RT";
                        let severity = if symbolic {
                            Severity::Warning
                        } else {
                            Severity::Error
                        };
                        told(severity, refused.to_string());
                    }
                    Ok(_) => {}
                }
            }
            Err(TransformError::Read(error)) => return Err(error),
            Err(refused) => told(Severity::Error, refused.to_string()),
        }
    }
    let mut members: BTreeMap<NodeId, u64> = BTreeMap::new();
    let mut circles = BTreeSet::new();
    let hung: BTreeSet<NodeId> = parents.iter().flat_map(|(&a, &b)| [a, b]).collect();
    for &node in &hung {
        let mut seen = BTreeSet::from([node]);
        let mut root = node;
        while let Some(&parent) = parents.get(&root) {
            root = parent;
            if !seen.insert(root) {
                // Named by its first node, once.
                let circle = circle(&parents, root);
                circles.insert(circle);
                break;
            }
        }
        if !parents.contains_key(&root) {
            *members.entry(root).or_default() += 1;
        }
    }
    let name = |id: NodeId| -> Result<String, ReadError> {
        let node = snapshot.find_node(id)?;
        Ok(node
            .map(|node| node.name())
            .transpose()?
            .unwrap_or_default())
    };
    for circle in circles {
        let message = TransformError::Cycle(name(circle)?).to_string();
        told(Severity::Error, message);
    }
    if members.len() > 1 {
        let mut trees = Vec::new();
        for (root, count) in members {
            let nodes = if count == 1 { "node" } else { "nodes" };
            trees.push(format!("`{}` with {count} {nodes}", name(root)?));
        }
        let message = format!(
            "poses form {} trees that nothing connects: {}",
            trees.len(),
            trees.join(", ")
        );
        told(Severity::Warning, message);
    }
    for node in &nodes {
        if let Some(Value::U64(parent)) = node.value("parent")?
            && parent != 0
            && snapshot.find_node(NodeId(parent))?.is_none()
        {
            let message = format!(
                "the `parent` of `{}` is {parent}, which is not in the graph",
                node.name()?
            );
            told(Severity::Warning, message);
        }
    }
    Ok(problems)
}

/// The least node of the circle that `node` is on.
fn circle(parents: &BTreeMap<NodeId, NodeId>, node: NodeId) -> NodeId {
    let mut least = node;
    let mut at = node;
    while let Some(&next) = parents.get(&at) {
        if next == node {
            break;
        }
        least = least.min(next);
        at = next;
    }
    least
}
