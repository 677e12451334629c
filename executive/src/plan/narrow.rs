//! Planning where there are too many ground actions to make them all: a way to the goal that ignores what
//! rules take away is found without keeping the actions, and a plan is sought among the actions on the
//! nodes of that way, then also on their neighbours. This file guarantees that what it gives is a plan
//! of the rules; it never says that there is none unless even that way does not exist.

use super::{Asked, Outcome, Status, reason, search_in};
use crate::ground::{Arrival, Atom, Facts, Link, Object, Problem, Reached, Scope};
use crate::search::{Limits, StopReason};
use fixedbitset::FixedBitSet;
use rustc_hash::FxHashSet;

/// How many links from the way's nodes others are counted in.
const FARTHEST: usize = 3;

/// A plan among few actions; `None` where there is none among them.
///
/// # Errors
/// The limit that was met on the way.
pub(super) fn plan(
    asked: Asked<'_>,
    limits: &mut Limits<'_>,
) -> Result<Option<Outcome>, StopReason> {
    let Asked {
        problem,
        options,
        awake,
        many,
    } = asked;
    let way = problem.reach(awake, Scope::Way, limits)?;
    if way.goals.is_empty() {
        if way.truncated {
            return Ok(None);
        }
        let (spares, expanded) = (Some(options.spares), limits.expanded());
        let reason = reason::why_unsolvable(problem, options, spares, &way, None, expanded);
        let outcome = Outcome::without_plan(Status::Unsolvable, reason, expanded);
        return Ok(Some(outcome));
    }
    let Relaxed { mut objects, .. } = Relaxed::of(problem, &way, &problem.world.facts);
    drop(way);
    for _ in 0..=FARTHEST {
        let reached = problem.reach(awake, Scope::At(objects.clone(), many), limits)?;
        if reached.overflow {
            return Ok(None);
        }
        let outcome = search_in(asked, &reached, limits);
        if outcome.status != Status::Unsolvable {
            // Other actions might do it for less.
            return Ok(Some(Outcome {
                optimal: false,
                ..outcome
            }));
        }
        if !widen(problem, &mut objects) {
            return Ok(None);
        }
    }
    Ok(None)
}

/// What a way to the goal that ignores what rules take away is about.
#[derive(Debug, Default)]
pub(super) struct Relaxed {
    /// The objects of the instances on it, and of the goal.
    pub(super) objects: FixedBitSet,
    /// What the instances on it bring about for one another and for the goal.
    pub(super) facts: Vec<Atom>,
}

impl Relaxed {
    /// Follows the way back from the goal to what holds at first, by `facts`.
    pub(super) fn of(problem: &Problem, way: &Reached, facts: &Facts) -> Self {
        let mut relaxed = Self::default();
        let mut taken = FixedBitSet::with_capacity(way.instances.len());
        let mut open: Vec<Arrival> = Vec::new();
        let mut met = FxHashSet::default();
        if let Some(goal) = way.goals.first() {
            relaxed.add_objects(&goal[..problem.goal.bound]);
            let links = problem.goal.links.iter();
            open.extend(links.map(|link| Arrival::Link(link.at(goal))));
        }
        while let Some(arrival) = open.pop() {
            let (there, atom) = match arrival {
                Arrival::Link(link) => (facts.has_link(link), Atom::Link(link)),
                Arrival::Type(object, exact) => (
                    facts.types(object).contains(&exact),
                    Atom::Type(object, exact),
                ),
            };
            let Some(&index) = way.achieved.get(&arrival).filter(|_| !there) else {
                continue;
            };
            if met.insert(arrival) {
                relaxed.facts.push(atom);
            }
            if taken.put(index) {
                continue;
            }
            let instance = &way.instances[index];
            let operator = &problem.program.operators[instance.operator];
            relaxed.add_objects(&instance.objects[..operator.variables.len()]);
            let links = operator.links.iter();
            open.extend(links.map(|link| Arrival::Link(link.at(&instance.objects))));
            for (slot, variable) in operator.variables[..operator.bound].iter().enumerate() {
                let object = instance.objects[slot];
                let types = variable.types.ones();
                open.extend(types.map(|exact| Arrival::Type(object, exact as u16)));
            }
        }
        relaxed
    }

    fn add_objects(&mut self, objects: &[Object]) {
        for &object in objects {
            self.objects.grow_and_insert(object as usize);
        }
    }
}

/// Counts in what is one link away; whether there was anything.
fn widen(problem: &Problem, objects: &mut FixedBitSet) -> bool {
    let before = objects.count_ones(..);
    let near: Vec<Link> = objects
        .ones()
        .filter(|&object| object < problem.world.nodes.len())
        .flat_map(|object| problem.world.facts.links_at(object as Object))
        .collect();
    for Link { from, to, .. } in near {
        objects.grow_and_insert(from as usize);
        objects.grow_and_insert(to as usize);
    }
    objects.count_ones(..) > before
}

#[cfg(test)]
mod tests {
    use crate::testing::{add, goal, read};
    use crate::{Effort, Limits, Options, Outcome, Status, plan};
    use dsr::{Graph, Schema, Time, Transaction};
    use grammar::Grammar;

    const RULES: &str = "name=halls
===
types { (robot room thing : item) }
===
go : active(1) { { r:robot a:room b:room r->a(in) } => { r:robot a:room b:room r->b(in) } }
pick : active(1)
{
	{ r:robot a:room t:thing r->a(in) t->a(in) r->r(free) }
	=>
	{ r:robot a:room t:thing r->a(in) r->t(has) }
}
place : active(1)
{
	{ r:robot a:room t:thing r->a(in) r->t(has) }
	=>
	{ r:robot a:room t:thing r->a(in) t->a(in) r->r(free) }
}
";

    /// A robot in the first of so many rooms, each a door from all others, with a thing in each.
    fn halls(rooms: usize) -> Graph {
        let mut graph = Graph::in_memory(Schema::open());
        let names: Vec<[String; 2]> = (0..rooms)
            .map(|n| [format!("room{n}"), format!("thing{n}")])
            .collect();
        let mut nodes = vec![("robot", "shelly")];
        let mut links = vec![("shelly", "in", "room0"), ("shelly", "free", "shelly")];
        for [room, thing] in &names {
            nodes.extend([("room", room.as_str()), ("thing", thing.as_str())]);
            links.push((thing, "in", room));
        }
        add(&mut graph, &nodes, &links);
        graph
    }

    fn solve(rooms: usize, wanted: &str, limits: Limits<'_>) -> Outcome {
        let grammar = read(RULES);
        let wanted = goal(&grammar, wanted);
        let options = Options {
            effort: Effort::First,
            ..Options::default()
        };
        let mut limits = limits;
        let graph = halls(rooms);
        plan(&grammar, &graph.snapshot(), &wanted, &options, &mut limits).unwrap()
    }

    const SWAP: &str = r#"{ "thing5":thing "thing9":thing "room5":room "room9":room
        "thing5"->"room9"(in) "thing9"->"room5"(in) }"#;

    #[test]
    fn a_plan_is_found_among_more_actions_than_are_made() {
        // 400 rooms make 160,000 ways to go, and as many to pick and to place.
        let few = Limits::new().with_bytes(40_000_000);
        let outcome = solve(400, SWAP, few);
        assert_eq!(outcome.status, Status::Solved, "{:?}", outcome.reason);
        assert!(!outcome.optimal);
        let small = solve(12, SWAP, Limits::new());
        assert_eq!(outcome.cost, small.cost);
        assert_eq!(outcome.steps.len(), small.steps.len());
    }

    #[test]
    fn what_no_way_leads_to_is_unsolvable_without_making_all_actions() {
        let wanted = r#"{ "thing5":thing "room5":room "room5"->"thing5"(in) }"#;
        let outcome = solve(400, wanted, Limits::new().with_bytes(40_000_000));
        assert_eq!(outcome.status, Status::Unsolvable);
        let reason = outcome.reason.unwrap();
        assert!(
            reason.contains("room5 -in-> thing5 cannot be reached"),
            "{reason}"
        );
    }

    /// The halls where a room holds one thing, all but one full: to swap two things one of them has to wait in the
    /// empty room, to which no link leads and which no way needs that ignores what rules take away.
    fn full_halls(rooms: usize) -> (Grammar, Graph) {
        let holding = "{ r:robot a:room t:thing r->a(in) r->t(has) }";
        let holding_in_empty = "{ r:robot a:room t:thing r->a(in) r->t(has) a->a(empty) }";
        let mut graph = halls(rooms);
        let mut transaction = Transaction::new();
        transaction.delete_node("thing1");
        transaction.create_edge("room1", "empty", "room1");
        graph.commit(&transaction, "test", Time::default()).unwrap();
        (read(&RULES.replace(holding, holding_in_empty)), graph)
    }

    #[test]
    fn what_the_way_passes_by_is_found_without_making_all_actions() {
        for effort in [Effort::First, Effort::Anytime] {
            let options = Options {
                effort,
                ..Options::default()
            };
            let (grammar, graph) = full_halls(350);
            let (wanted, snapshot) = (goal(&grammar, SWAP), graph.snapshot());
            let few = Limits::new().with_bytes(40_000_000);
            let mut few = few.with_expansions(100_000);
            let outcome = plan(&grammar, &snapshot, &wanted, &options, &mut few).unwrap();
            assert_eq!(outcome.status, Status::Solved, "{:?}", outcome.reason);
            // One thing to the empty room, the other to its place, and the first to the other's.
            assert_eq!(outcome.steps.len(), 12);
        }
    }

    #[test]
    fn a_search_that_makes_no_actions_says_how_far_it_came() {
        let (grammar, graph) = full_halls(350);
        let mut few = Limits::new().with_expansions(60);
        let (wanted, snapshot) = (goal(&grammar, SWAP), graph.snapshot());
        let outcome = plan(&grammar, &snapshot, &wanted, &Options::default(), &mut few).unwrap();
        assert_eq!((outcome.status, outcome.expanded), (Status::Limit, 60));
        let reason = outcome.reason.unwrap();
        assert!(
            reason.contains("the nearest state still lacked thing"),
            "{reason}"
        );
    }

    #[test]
    fn the_clock_is_kept_on_the_way() {
        let mut asked = 0.0;
        let clock = move || {
            asked += 1.0;
            asked
        };
        let outcome = solve(400, SWAP, Limits::new().with_clock(20.0, clock));
        assert_eq!(outcome.status, Status::Limit, "{:?}", outcome.reason);
    }
}
