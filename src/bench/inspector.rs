//! What it costs that somebody looks: commits with a page beside them and without, in turns, the
//! inspector's share of a processor, and how long a page waits for a large graph.

use super::beside::Taken;
use super::figure::{Figure, median};
use super::hall::Hall;
use super::{Effort, PATIENCE, peer};
use crate::Failure;
use crate::supervise::cpu_seconds;
use dsr::{EdgeRef, Operation, Pose, Session, Time, Transaction, Value};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Nodes of a graph that somebody looks at,
const NODES: usize = 5000;
/// how many of them are people who move,
const PEOPLE: usize = 200;
/// and how often they do, a second.
const RATE: f64 = 30.0;

/// `cortex inspect --web` beside a store. It ends with this.
struct Inspector {
    child: Child,
    address: String,
}

impl Drop for Inspector {
    fn drop(&mut self) {
        // It may have ended already, which is as good.
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

impl Inspector {
    fn start(hall: &Hall) -> Result<Self, Failure> {
        let program = std::env::current_exe().map_err(Failure::internal)?;
        let mut child = Command::new(program)
            .args(["inspect", "--web", "127.0.0.1:0", "--instance", hall.name()])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(Failure::internal)?;
        let output = child.stdout.take();
        let mut inspector = Self {
            child,
            address: String::new(),
        };
        let mut line = String::new();
        if let Some(output) = output {
            let read = BufReader::new(output).read_line(&mut line);
            read.map_err(Failure::internal)?;
        }
        let address = line.trim().strip_prefix("http://");
        let address = address.and_then(|rest| rest.strip_suffix('/'));
        let address = address.ok_or_else(|| Failure::internal("the inspector has no page"))?;
        address.clone_into(&mut inspector.address);
        Ok(inspector)
    }

    fn ask(&self, path: &str) -> Result<TcpStream, Failure> {
        let mut stream = TcpStream::connect(&self.address).map_err(Failure::internal)?;
        let host = &self.address;
        let request = format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
        let sent = stream.write_all(request.as_bytes());
        sent.map_err(Failure::internal)?;
        let patience = stream.set_read_timeout(Some(PATIENCE));
        patience.map_err(Failure::internal)?;
        Ok(stream)
    }

    /// Listens as a page does, from the first frame on.
    fn listen(&self) -> Result<Page, Failure> {
        let mut stream = self.ask("/api/events")?;
        let reading = stream.try_clone().map_err(Failure::internal)?;
        let mut buffer = vec![0; 1 << 16];
        let mut heard = Vec::new();
        while !heard.windows(6).any(|bytes| bytes == b"data: ") {
            match stream.read(&mut buffer).map_err(Failure::internal)? {
                0 => return Err(Failure::internal("the inspector tells nothing")),
                count => heard.extend_from_slice(&buffer[..count]),
            }
        }
        let reader = std::thread::spawn(move || {
            let mut reading = reading;
            let mut bytes = 0;
            while let Ok(count @ 1..) = reading.read(&mut buffer) {
                bytes += count;
            }
            bytes
        });
        Ok(Page { stream, reader })
    }

    fn cpu(&self) -> Result<f64, Failure> {
        let seconds = cpu_seconds(self.child.id());
        seconds.ok_or_else(|| Failure::internal("the inspector has ended"))
    }
}

/// One that listens.
struct Page {
    stream: TcpStream,
    reader: JoinHandle<usize>,
}

impl Page {
    /// Stops; how many bytes it was told.
    fn leave(self) -> Result<usize, Failure> {
        let shut = self.stream.shutdown(Shutdown::Both);
        shut.map_err(Failure::internal)?;
        let told = self.reader.join();
        told.map_err(|_| Failure::internal("the page's thread panicked"))
    }
}

/// Commits with a page that listens and without one, in turns.
pub(super) fn commits(
    hall: &Hall,
    effort: Effort,
    figures: &mut Vec<Figure>,
) -> Result<(), Failure> {
    let inspector = Inspector::start(hall)?;
    let mut session = hall.session("committer")?;
    session.set_spin(PATIENCE);
    let everywhere = peer::sit(0)?;
    let (mut alone, mut seen) = (Taken::default(), Taken::default());
    for _ in 0..2 * effort.joins {
        alone.go_on(&mut session)?;
        let page = inspector.listen()?;
        seen.go_on(&mut session)?;
        page.leave()?;
    }
    peer::stand(&everywhere)?;
    figures.push(Figure {
        name: "commit_ack_inspected",
        value: seen.mean(),
        unit: "us",
        raw: Some(alone.mean()),
        peer: format!("no page beside it, mean of {}", alone.commits),
    });
    Ok(())
}

fn furnish(session: &mut Session) -> Result<(), Failure> {
    let mut transaction = Transaction::new();
    transaction.create_node("world", "world", vec![]);
    for index in 0..PEOPLE {
        let name = format!("person_{index}");
        transaction.create_node("person", &name, vec![]);
    }
    for index in 0..NODES - PEOPLE - 1 {
        let room = format!("thing_{}", index / 100 * 100);
        let name = format!("thing_{index}");
        transaction.create_node("thing", &name, vec![("size".into(), 1.5.into())]);
        if name != room {
            transaction.create_edge(name.as_str(), "in", room.as_str());
        }
    }
    super::commits::commit(session, &transaction)
}

fn walk(step: u32) -> Transaction {
    let mut transaction = Transaction::new();
    for index in 0..PEOPLE {
        let angle = f64::from(step) / 100.0 + index as f64;
        let pose = Pose::translation(5.0 * angle.cos(), 5.0 * angle.sin(), 0.0);
        transaction.push(Operation::CreateEdge {
            edge: EdgeRef::new("world", "pose", format!("person_{index}")),
            attributes: vec![("transform".into(), Value::Pose(pose))],
        });
    }
    transaction
}

/// A page beside people who move.
pub(super) fn load(effort: Effort, figures: &mut Vec<Figure>) -> Result<(), Failure> {
    let hall = Hall::open()?;
    let store = hall.sleeping_store(0)?;
    let mut session = hall.session("mover")?;
    furnish(&mut session)?;
    let inspector = Inspector::start(&hall)?;
    let mut waits = Vec::new();
    for _ in 0..effort.joins.max(3) {
        let asked = Instant::now();
        let mut answer = Vec::new();
        let read = inspector.ask("/api/graph")?.read_to_end(&mut answer);
        read.map_err(Failure::internal)?;
        waits.push(asked.elapsed().as_nanos() as u64);
    }
    let page = inspector.listen()?;
    let (start, before) = (Instant::now(), inspector.cpu()?);
    let steps = (RATE * effort.joins as f64) as u32;
    for step in 0..steps {
        let time = Time::from_seconds(f64::from(step) / RATE);
        let moved = session.commit(&walk(step), time);
        moved.map_err(Failure::internal)?;
        let next = start + Duration::from_secs_f64(f64::from(step + 1) / RATE);
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    let cores = (inspector.cpu()? - before) / start.elapsed().as_secs_f64();
    let told = page.leave()?;
    store.end()?;
    figures.push(Figure {
        name: "inspector_cores",
        value: cores,
        unit: "cores",
        raw: None,
        peer: format!("{PEOPLE} of {NODES} nodes move {RATE} times a second, {told} bytes told"),
    });
    figures.push(Figure {
        name: "inspector_first_answer",
        value: median(&mut waits) / 1e6,
        unit: "ms",
        raw: None,
        peer: format!("a graph of {NODES} nodes"),
    });
    Ok(())
}
