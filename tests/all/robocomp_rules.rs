//! Files as RoboComp's editor writes them, of before and after 2017: all of their rules are read, and each
//! defect has its place.

use crate::support::Program;
use serde_json::{Value, json};
use std::fs;
use tempfile::TempDir;

/// Without types, with settings of the editor, places to draw at, numbers for variables, `eq`, effects over
/// several lines, a starred link on the right.
const OLD: &str = "fontName=Ubuntu
fontSize=14
name=shelves
nodeThickness=2.5
===
stopMoving : active(1)
{
	{
		1:robot(-96,4)
		1->1(stopped)*
	}
	=>
	{
		1:robot(-96,4)
		1->1(stopped)
	}
	precondition
	{
	}
	effect
	{
		(and
			(forall other:robot
				(when
					(not (eq 1 other))
					(not (leads other 1))
				)
			)
		)
	}
}

reach : active(3)
{
	{
		1:robot(0,0)
		2:table(60,-12.5)
		3:object(120,0)
		3->2(in)
		1->3(know)
	}
	=>
	{
		1:robot(0,0)
		2:table(60,-12.5)
		3:object(120,0)
		3->2(in)
		1->3(know)
		1->3(reach)
		1->1(moving)*
	}
	precondition
	{
		(not (exists o:object (reach 1 o)))
	}
	effect
	{
	}
}
";

/// With types, an include, sleeping and waking rules, probabilities, a summary, and a combo.
const NEW: &str = "name=kitchen
fontSize=14
===
types
{
	(thing)
	(object container : thing)
	(cup : object container)
	(robot table : thing)
}
===
include(old.aggl)

dormant pour : active(4) success(0.8)
{
	{
		r:robot(0,0)
		c:cup(40,0)
		r->c(has)
		c->c(full)*
	}
	=>
	{
		r:robot(0,0)
		c:cup(40,0)
		r->c(has)
		c->c(full)
	}
	parameters
	{
		t:table
	}
	precondition
	{
		(or (in c t) (has r c))
	}
	effect
	{
	}
}

grasp : active(2) success(0.9) activates(pour)
{
	{
		r:robot(0,0)
		c:cup(40,0)
		t:table(80,0)
		c->t(in)
		r->c(reach)
	}
	=>
	{
		r:robot(0,0)
		c:cup(40,0)
		t:table(80,0)
		r->c(has)
	}
}

hierarchical serve : active(9)
{
	{
		r:robot(0,0)
		c:cup(40,0)
	}
	=>
	{
		r:robot(0,0)
		c:cup(40,0)
		r->c(has)
		c->c(full)
	}
}

reachAndGrasp : active(5)
{
	reach as first optional
	grasp as second
	where:
	(first.1 = second.r)
	(first.3 = second.c)
	first.2 = second.t
}
";

const GOAL: &str = "{
	1:robot(0,0)
	c:cup(50,0)
	1->c(has)
}
precondition
{
	(forall other:cup (when (not (= other c)) (not (has 1 other))))
}
";

const WORLD: &str = r#"{"format":"dsr/1","nodes":[
    {"id":1,"type":"robot","name":"shelly"},{"id":2,"type":"table","name":"desk"},
    {"id":3,"type":"cup","name":"mine"}],
    "edges":[{"from":3,"label":"in","to":2},{"from":1,"label":"know","to":3}]}"#;

struct Files(TempDir);

impl Files {
    fn new(files: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            fs::write(folder.path().join(name), text).unwrap();
        }
        Self(folder)
    }

    /// Exit code, standard output and standard error; names of files are taken in the folder.
    fn cortex(&self, arguments: &str) -> (i32, String, String) {
        let path = |word: &str| {
            let file = self.0.path().join(word);
            let known = word.contains('.') && file.exists();
            if known {
                file.display().to_string()
            } else {
                word.to_owned()
            }
        };
        let words: Vec<String> = arguments.split_whitespace().map(path).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let output = Program::run(&words);
        let text = |bytes| String::from_utf8(bytes).unwrap();
        let code = output.status.code().unwrap();
        (code, text(output.stdout), text(output.stderr))
    }

    fn json(&self, arguments: &str) -> Value {
        let (_, out, told) = self.cortex(arguments);
        serde_json::from_str(&out).unwrap_or_else(|_| panic!("{out}{told}"))
    }
}

fn names(rules: &Value) -> Vec<&str> {
    let rules = rules.as_array().unwrap().iter();
    rules.map(|rule| rule["name"].as_str().unwrap()).collect()
}

#[test]
fn files_of_both_ages_are_read_matched_and_planned_with() {
    let files = Files::new(&[
        ("old.aggl", OLD),
        ("new.aggl", NEW),
        ("goal.aggt", GOAL),
        ("world.json", WORLD),
    ]);
    for file in ["old.aggl", "new.aggl"] {
        let (code, _, told) = files.cortex(&format!("rules check {file}"));
        assert!(code == 0 && !told.contains("error"), "{told}");
    }
    let (code, out, _) = files.cortex("rules check goal.aggt");
    assert!(
        code == 0 && out.ends_with("a goal, 2 nodes, 1 links\n"),
        "{out}"
    );
    let (code, _, told) = files.cortex("rules list goal.aggt");
    assert!(
        code == 2 && told.contains("is a goal, and a grammar (.aggl) is expected"),
        "{told}"
    );

    let list = files.json("rules list new.aggl --json");
    let all = [
        "stopMoving",
        "reach",
        "pour",
        "grasp",
        "serve",
        "reachAndGrasp",
    ];
    assert_eq!(names(&list["rules"]), all);
    let [_, _, pour, grasp, serve, combo] = &list["rules"].as_array().unwrap()[..] else {
        panic!("{list}");
    };
    assert_eq!(
        (&pour["dormant"], &pour["success"]),
        (&json!(true), &json!(0.8))
    );
    assert_eq!(pour["parameters"], json!([{"name": "t", "type": "table"}]));
    assert_eq!(
        (&grasp["cost"], &serve["hierarchical"]),
        (&json!(2.0), &json!(true))
    );
    let variants = ["reachAndGrasp", "reachAndGrasp_without_first"];
    assert_eq!(
        (&combo["combo"], names(&combo["variants"])),
        (&json!(true), variants.to_vec())
    );

    // What is printed says the same, the included rules among it left to their file.
    let (code, printed, _) = files.cortex("rules fmt new.aggl");
    assert_eq!(code, 0);
    fs::write(files.0.path().join("again.aggl"), &printed).unwrap();
    let again = files.json("rules list again.aggl --json");
    assert_eq!(again["rules"], list["rules"]);

    let count = |rule: &str| {
        let arguments = format!("rules match new.aggl --rule {rule} --world world.json --json");
        files.json(&arguments)["count"].clone()
    };
    assert_eq!(
        [count("reach"), count("grasp"), count("reachAndGrasp")],
        [1, 0, 1]
    );
    let (code, out, told) = files.cortex("plan new.aggl world.json goal.aggt --optimal");
    assert_eq!(code, 0, "{told}");
    assert!(out.contains("reach"), "{out}");
}

#[test]
fn what_is_missing_or_wrong_in_them_has_its_place_and_the_rest_is_read() {
    let broken = NEW
        .replace("include(old.aggl)", "include(gone.aggl)")
        .replace("r->c(reach)", "r->cup1(reach)");
    let files = Files::new(&[("broken.aggl", &broken)]);
    let (code, _, told) = files.cortex("rules check broken.aggl");
    let line = |part: &str| 1 + broken.lines().position(|line| line.contains(part)).unwrap();
    assert_eq!(code, 2);
    let place = |part: &str, message: &str| {
        let at = format!("broken.aggl:{}:", line(part));
        let mut lines = told.lines();
        assert!(
            lines.any(|line| line.contains(&at) && line.contains(message)),
            "{at} {message}\n{told}"
        );
    };
    place(
        "include(gone.aggl)",
        "cannot read the included file `gone.aggl`",
    );
    place("cup1", "no variable `cup1` on the left side");
    let list = files.json("rules list broken.aggl --json");
    assert_eq!(
        names(&list["rules"]),
        ["pour", "grasp", "serve", "reachAndGrasp"]
    );
}
