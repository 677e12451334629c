//! The inspector from outside: what its server answers, to whom, and the page in a browser where one is
//! installed.

mod browser;
mod page;
mod terminal;

use crate::support::{Process, Program, TestInstance};
use dsr::{EdgeRef, Operation, Session, Time, Transaction, Value};
use serde_json::{Value as Json, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Stdio};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(20);

/// A store with a room, a robot and people, and the inspector looking at it.
struct Inspected {
    _server: Ending,
    address: String,
    token: Option<String>,
    session: Session,
    _store: Stored,
    _instance: TestInstance,
}

/// What keeps the graph.
#[expect(dead_code, reason = "held for as long as it is to run")]
enum Stored {
    Peer(Process),
    Program(Ending),
}

/// A process that is killed with the test.
struct Ending(Child);

impl Drop for Ending {
    fn drop(&mut self) {
        // It may have ended already, which is as good.
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

fn furnish(session: &mut Session, people: usize) {
    let mut transaction = Transaction::new();
    let walls = Value::F64List(vec![0.0, 0.0, 8.0, 0.0, 8.0, 0.0, 8.0, 5.0]);
    transaction.create_node("world", "world", vec![("walls".into(), walls)]);
    transaction.create_node("room", "kitchen", vec![]);
    let speed = vec![("max_speed".into(), 0.5.into())];
    transaction.create_node("robot", "robot", speed);
    transaction.create_edge("robot", "in", "kitchen");
    for index in 0..people {
        let name = format!("person_{index}");
        transaction.create_node("person", &name, vec![]);
        transaction.create_edge(name.as_str(), "in", "kitchen");
        let at = [1.0 + (index % 7) as f64, 1.0 + (index % 3) as f64];
        let pose = dsr::Pose::translation(at[0], at[1], 0.0);
        transaction.push(Operation::CreateEdge {
            edge: EdgeRef::new("world", "pose", name),
            attributes: vec![("transform".into(), Value::Pose(pose))],
        });
    }
    session
        .commit(&transaction, Time::from_seconds(1000.0))
        .unwrap();
}

impl Inspected {
    fn new(test: &str, people: usize, more: &[&str]) -> Self {
        let instance = TestInstance::new(test);
        let store = Stored::Peer(Process::peer("store", &instance));
        let mut session = Session::attach(&instance.0, "setup", PATIENCE).unwrap();
        furnish(&mut session, people);
        Self::look(instance, store, session, more)
    }

    /// The care centre before anybody has started, and the inspector looking at it.
    fn care_centre(test: &str, more: &[&str]) -> Self {
        let instance = TestInstance::new(test);
        let name = instance.name().to_owned();
        let scenario = ["store", "--scenario", "scenarios/care-centre"];
        let mut store = Program::command(&[&scenario[..], &["--instance", &name]].concat());
        let store = store.stderr(Stdio::null()).stdout(Stdio::null()).spawn();
        let store = Stored::Program(Ending(store.unwrap()));
        // The agent that may change everything.
        let session = Session::attach(&instance.0, "cortex-graph", PATIENCE).unwrap();
        Self::look(instance, store, session, more)
    }

    fn look(instance: TestInstance, store: Stored, session: Session, more: &[&str]) -> Self {
        let web = [
            "inspect",
            "--web",
            "127.0.0.1:0",
            "--instance",
            instance.name(),
        ];
        let mut server = Program::command(&[&web, more].concat())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let output = server.stdout.take().unwrap();
        BufReader::new(output).read_line(&mut line).unwrap();
        let rest = line.trim().strip_prefix("http://").expect(&line);
        let (address, token) = rest.split_once('/').unwrap();
        Self {
            _server: Ending(server),
            address: address.to_owned(),
            token: token.strip_prefix("#token=").map(str::to_owned),
            session,
            _store: store,
            _instance: instance,
        }
    }

    /// Sends a request; the status and the body.
    fn send(&self, request: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        (status, body.to_owned())
    }

    fn get_as(&self, host: &str, path: &str) -> (u16, String) {
        self.send(&format!(
            "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
        ))
    }

    fn get(&self, path: &str) -> Json {
        let (status, body) = self.get_as(&self.address, path);
        assert_eq!(status, 200, "{path}: {body}");
        serde_json::from_str(&body).unwrap_or_else(|error| panic!("{path}: {error}: {body}"))
    }

    /// The page's address, of one view.
    fn url(&self, view: &str) -> String {
        let token = self.token.as_ref();
        let token = token.map_or_else(String::new, |token| format!("token={token}&"));
        format!("http://{}/#{token}view={view}", self.address)
    }

    fn edit(&self, token: &str, change: &Json) -> (u16, Json) {
        let (host, body) = (&self.address, change.to_string());
        let (status, body) = self.send(&format!(
            "POST /api/edit HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\
             X-Cortex-Token: {token}\r\nContent-Length: {}\r\n\r\n{body}",
            body.len()
        ));
        (status, serde_json::from_str(&body).unwrap())
    }
}

#[test]
fn every_question_of_the_page_is_answered_as_of_now_and_as_of_then() {
    let mut inspected = Inspected::new("answers", 4, &[]);
    let about = inspected.get("/api/about");
    assert_eq!(
        (&about["live"], &about["allow_edit"]),
        (&json!(true), &json!(false))
    );
    assert_eq!(about["nodes"], 7);
    let graph = inspected.get("/api/graph");
    assert_eq!(graph["nodes"].as_array().unwrap().len(), 7);
    let map = inspected.get("/api/map");
    assert_eq!(map["people"].as_array().unwrap().len(), 4);
    assert_eq!(map["walls"].as_array().unwrap().len(), 2);
    let mut faster = Transaction::new();
    faster.set("robot", "max_speed", 0.7);
    inspected
        .session
        .commit(&faster, Time::from_seconds(1010.0))
        .unwrap();
    let id = graph["nodes"].as_array().unwrap().iter();
    let id = id.clone().find(|node| node[1] == "robot").unwrap()[0].clone();
    let speed = |at: &str| {
        let node = inspected.get(&format!("/api/node?id={id}{at}"));
        let attribute = node["attributes"][0].clone();
        assert_eq!(attribute["writer"], "setup");
        attribute["value"].clone()
    };
    assert_eq!((speed(""), speed("&at=1005")), (json!(0.7), json!(0.5)));
    let history = inspected.get("/api/history?path=robot.max_speed");
    assert_eq!(history["entries"].as_array().unwrap().len(), 2);
    let why = inspected.get("/api/why?path=robot.max_speed");
    assert!(why["text"].as_str().unwrap().contains("by setup"), "{why}");
    let commits = inspected.get("/api/commits?at=1005");
    let told = commits.as_array().unwrap().len();
    assert_eq!(
        (told, &commits[0]["agent"]),
        (1, &json!("setup")),
        "{commits}"
    );
    assert_eq!(inspected.get("/api/missions"), json!([]));
    assert_eq!(inspected.get("/api/agenda")["activities"], json!([]));
    assert_eq!(inspected.get("/api/rules"), json!([]));
    assert_eq!(inspected.get("/api/grid"), json!(null));
    let (_, figures) = inspected.get_as(&inspected.address, "/metrics");
    assert!(figures.contains("\ncortex_nodes 7\n"), "{figures}");
    assert!(
        figures.contains("cortex_process_memory_bytes{process="),
        "{figures}"
    );
    let (status, _) = inspected.get_as(&inspected.address, "/api/nonsense");
    assert_eq!(status, 404);
    let (status, body) = inspected.get_as(&inspected.address, "/api/history?path=nobody.x");
    assert_eq!(status, 400, "{body}");
}

#[test]
fn another_site_cannot_ask_through_the_browser_and_the_page_loads_only_itself() {
    let inspected = Inspected::new("hosts", 1, &[]);
    let (status, _) = inspected.get_as("evil.example", "/api/about");
    assert_eq!(status, 403);
    let (status, page) = inspected.get_as("localhost", "/");
    assert_eq!(status, 200);
    for file in ["style.css", "main.js"] {
        assert!(page.contains(file), "{file}");
        assert_eq!(inspected.get_as("localhost", &format!("/{file}")).0, 200);
    }
    assert_eq!(inspected.get_as("localhost", "/../Cargo.toml").0, 404);
}

#[test]
fn nothing_is_changed_unless_that_was_allowed_and_the_asker_has_the_token() {
    let change = json!({"kind": "set", "path": "robot.max_speed", "value": "0.3"});
    let shut = Inspected::new("shut", 0, &[]);
    assert_eq!(shut.token, None);
    assert_eq!(shut.edit("", &change).0, 403);
    let open = Inspected::new("open", 0, &["--allow-edit"]);
    let token = open.token.clone().unwrap();
    assert_eq!(open.edit("guess", &change).0, 401);
    let (status, said) = open.edit(&token, &change);
    assert_eq!(status, 200, "{said}");
    let history = open.get("/api/history?path=robot.max_speed");
    assert_eq!(history["entries"][0]["agent"], "inspector");
    let refused = json!({"kind": "set", "path": "nobody.max_speed", "value": "1"});
    assert_eq!(open.edit(&token, &refused).0, 400);
    let mission = json!({"kind": "mission", "name": "rest", "goal": "{\n\t\"robot\":robot\n}\n"});
    assert_eq!(open.edit(&token, &mission).0, 200);
    assert_eq!(open.get("/api/missions")[0]["name"], "rest");
    assert_eq!(open.edit(&token, &json!({"kind": "explode"})).0, 400);
}

#[test]
fn what_happens_is_told_as_it_happens() {
    let mut inspected = Inspected::new("events", 2, &[]);
    let mut stream = TcpStream::connect(&inspected.address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let host = &inspected.address;
    let request = format!("GET /api/events HTTP/1.1\r\nHost: {host}\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut lines = BufReader::new(stream).lines().map(Result::unwrap);
    let mut frame = || -> Json {
        let line = lines.find(|line| line.starts_with("data: ")).unwrap();
        serde_json::from_str(&line["data: ".len()..]).unwrap()
    };
    // The first brings the map and the processes.
    let first = frame();
    assert_eq!(first["map"]["people"].as_array().unwrap().len(), 2);
    let mut moved = Transaction::new();
    let pose = dsr::Pose::translation(3.0, 1.0, 0.0);
    let edge = EdgeRef::new("world", "pose", "person_1");
    moved.set_on_edge(edge, "transform", Value::Pose(pose));
    inspected
        .session
        .commit(&moved, Time::from_seconds(1020.0))
        .unwrap();
    let told = loop {
        let frame = frame();
        if frame["count"].as_u64().unwrap_or(0) > 0 {
            break frame;
        }
    };
    assert_eq!(told["commits"][0]["agent"], "setup");
    assert_eq!(told["structure"], false);
    assert_eq!(told["map"]["people"][1]["place"][0], 3.0);
}
