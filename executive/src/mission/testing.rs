//! What the tests share: a small house, its rules, an agent that carries out steps.

mod house;

pub(super) use house::{Agent, House};

/// The rules of the house.
pub(super) const RULES: &str = "name=house
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

/// That ana looks at the robot.
pub(super) const GREET_ANA: &str = r#"{ "ana":person "shelly":robot "ana"->"shelly"(front) }"#;
/// That the robot is in the ward.
pub(super) const GO_TO_WARD: &str = r#"{ "shelly":robot "ward":room "shelly"->"ward"(in) }"#;
