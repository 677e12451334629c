//! What the tests share: a small house, its rules, an agent that carries out steps, and a planner
//! that searches whole graphs.

mod house;
mod planner;

pub(crate) use house::{Agent, House};
pub(crate) use planner::Exhaustive;

/// The rules of the house.
pub(crate) const RULES: &str = "name=house
===
types
{
(thing)
(room person robot mission step : thing)
}
===
changeRoom : active(1) agent(navigation) duration(5)
{
	{ robot:robot room1:room room2:room robot->room1(in) room1->room2(connected) }
	=>
	{ robot:robot room1:room room2:room robot->room2(in) room1->room2(connected) }
	effect { (forall p:person (when (is_near robot p) (not (is_near robot p)))) }
}
approach : active(2) agent(navigation)
{
	{ robot:robot room:room p:person robot->room(in) p->room(in) robot->p(is_near)* }
	=>
	{ robot:robot room:room p:person robot->room(in) p->room(in) robot->p(is_near) }
}
takeTheAttention : active(1) agent(navigation) duration(10)
{
	{ robot:robot p:person robot->p(is_near) p->robot(front)* }
	=>
	{ robot:robot p:person robot->p(is_near) p->robot(front) }
}
";

/// The names that the house's graph may use.
pub(crate) const SCHEMA: &str = r#"
[types]
thing = []
room = ["thing"]
person = ["thing"]
robot = ["thing"]
mission = ["thing"]
step = ["thing"]
[labels]
in = { from = ["person", "robot"], to = ["room"] }
connected = { from = ["room"], to = ["room"] }
is_near = { from = ["robot"], to = ["person"] }
front = { from = ["person"], to = ["robot"] }
has_step = { from = ["mission"], to = ["step"] }
[attributes]
goal = { kind = "string" }
status = { kind = "string" }
priority = { kind = "i64" }
replans = { kind = "u64" }
reason = { kind = "string" }
rule = { kind = "string" }
agent = { kind = "string" }
index = { kind = "u64" }
binding = { kind = "string" }
"#;

/// That ana looks at the robot.
pub(crate) const GREET_ANA: &str = r#"{ "ana":person "shelly":robot "ana"->"shelly"(front) }"#;
/// That the robot is in the ward.
pub(crate) const GO_TO_WARD: &str = r#"{ "shelly":robot "ward":room "shelly"->"ward"(in) }"#;
