//! A Chromium without a display, driven over its debugging pipe. It guarantees that it has ended when the
//! test has, and that nothing that the page complains of goes unheard.

use super::Ending;
use serde_json::{Value as Json, json};
use std::io::{BufRead, BufReader, Write};
use std::process::{ChildStdin, ChildStdout, Command, Stdio};
use tempfile::TempDir;

/// A page in a browser.
pub(super) struct Browser {
    _process: Ending,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    session: Option<String>,
    calls: u64,
    /// Exceptions of the page, and what its policy refused.
    complaints: Vec<String>,
    _profile: TempDir,
}

/// A desktop's screen, and a phone's.
pub(super) const DESKTOP: (u32, u32) = (1280, 720);
pub(super) const PHONE: (u32, u32) = (390, 844);

/// A browser that can be run without a display, where one is installed.
fn program() -> Option<&'static str> {
    ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|name| {
            let version = Command::new(name).arg("--version").output();
            version.is_ok_and(|output| output.status.success())
        })
}

impl Browser {
    /// Opens a page; `None` where no browser is installed.
    #[allow(clippy::print_stderr, reason = "a test that did not look must say so")]
    pub(super) fn open(url: &str, size: (u32, u32)) -> Option<Self> {
        let Some(program) = program() else {
            eprintln!("SKIPPED: no Chromium is installed, so the page was not looked at");
            return None;
        };
        let profile = tempfile::tempdir().unwrap();
        // The browser reads its pipe from 3 and writes to 4.
        let mut process = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 0</dev/null 1>/dev/null"])
            .arg(program)
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-quic",
            ])
            .args(["--no-first-run", "--disable-background-networking"])
            .args(["--disable-component-update", "--disable-sync"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("--remote-debugging-pipe")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let (input, output) = (process.stdin.take(), process.stdout.take());
        let mut browser = Self {
            _process: Ending(process),
            input: input.unwrap(),
            output: BufReader::new(output.unwrap()),
            session: None,
            calls: 0,
            complaints: Vec::new(),
            _profile: profile,
        };
        let target = browser.call("Target.createTarget", &json!({"url": "about:blank"}));
        let wanted = json!({"targetId": target["targetId"], "flatten": true});
        let attached = browser.call("Target.attachToTarget", &wanted);
        browser.session = attached["sessionId"].as_str().map(str::to_owned);
        let is_phone = size == PHONE;
        let screen = json!({
            "width": size.0, "height": size.1, "deviceScaleFactor": 1, "mobile": is_phone,
        });
        browser.call("Emulation.setDeviceMetricsOverride", &screen);
        browser.call(
            "Emulation.setTouchEmulationEnabled",
            &json!({"enabled": is_phone}),
        );
        for domain in ["Runtime", "Log", "Page", "Accessibility"] {
            browser.call(&format!("{domain}.enable"), &json!({}));
        }
        browser.call("Page.navigate", &json!({"url": url}));
        browser.until("document.body?.dataset.drawn");
        Some(browser)
    }

    fn send(&mut self, method: &str, parameters: &Json) -> u64 {
        self.calls += 1;
        let mut call = json!({"id": self.calls, "method": method, "params": parameters});
        if let Some(session) = &self.session {
            call["sessionId"] = json!(session);
        }
        self.input.write_all(call.to_string().as_bytes()).unwrap();
        self.input.write_all(&[0]).unwrap();
        self.calls
    }

    fn hear(&mut self) -> Json {
        let mut message = Vec::new();
        self.output.read_until(0, &mut message).unwrap();
        assert_eq!(message.pop(), Some(0), "the browser has ended");
        serde_json::from_slice(&message).unwrap()
    }

    /// Has the browser do something; what it answers.
    pub(super) fn call(&mut self, method: &str, parameters: &Json) -> Json {
        let id = self.send(method, parameters);
        loop {
            let mut message = self.hear();
            if message["id"] == id {
                assert!(message["error"].is_null(), "{method}: {message}");
                return message["result"].take();
            }
            let said = &message["params"];
            match message["method"].as_str() {
                Some("Runtime.exceptionThrown") => {
                    self.complaints.push(said["exceptionDetails"].to_string());
                }
                // A refusal of the server is shown by the page.
                Some("Log.entryAdded")
                    if said["entry"]["source"] != "network"
                        && said["entry"]["level"] == "error" =>
                {
                    self.complaints.push(said["entry"].to_string());
                }
                _ => {}
            }
        }
    }

    /// The value of an expression in the page.
    pub(super) fn value(&mut self, expression: &str) -> Json {
        let asked = json!({"expression": expression, "awaitPromise": true, "returnByValue": true});
        let mut answer = self.call("Runtime.evaluate", &asked);
        let thrown = &answer["exceptionDetails"];
        assert!(thrown.is_null(), "{expression}: {thrown}");
        answer["result"]["value"].take()
    }

    /// Waits until an expression holds; its value.
    pub(super) fn until(&mut self, expression: &str) -> Json {
        let waiting = format!(
            "new Promise((hold, fail) => {{
                const end = performance.now() + 20000;
                const look = () => {{
                    const value = {expression};
                    if (value) hold(value);
                    else if (performance.now() > end) fail(document.body?.innerText ?? 'no page');
                    else setTimeout(look, 20);
                }};
                look();
            }})"
        );
        self.value(&waiting)
    }

    /// Presses and releases a key.
    pub(super) fn key(&mut self, key: &str) {
        let code = match key {
            "Tab" => 9,
            "Enter" => 13,
            "ArrowLeft" => 37,
            "ArrowRight" => 39,
            _ => 0,
        };
        let text = match key {
            "Enter" => "\r",
            key if key.chars().count() == 1 => key,
            _ => "",
        };
        for kind in ["keyDown", "keyUp"] {
            let pressed = json!({
                "type": kind, "key": key, "text": if kind == "keyDown" { text } else { "" },
                "windowsVirtualKeyCode": code,
            });
            self.call("Input.dispatchKeyEvent", &pressed);
        }
    }

    /// Clicks the first thing of a CSS selector, as a mouse would.
    pub(super) fn click(&mut self, selector: &str) {
        let place = self.value(&format!(
            "(() => {{ const it = document.querySelector({}); it.scrollIntoView({{block: 'center'}});
                const box = it.getBoundingClientRect(); return [box.x + box.width / 2, box.y + box.height / 2]; }})()",
            json!(selector)
        ));
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({
                "type": kind, "x": place[0], "y": place[1], "button": "left", "clickCount": 1,
            });
            self.call("Input.dispatchMouseEvent", &event);
        }
    }

    /// Types into the field of a CSS selector what was not in it before.
    pub(super) fn fill(&mut self, selector: &str, text: &str) {
        let selected = format!(
            "(() => {{ const it = document.querySelector({}); it.focus(); it.select(); return true; }})()",
            json!(selector)
        );
        assert_eq!(self.value(&selected), true);
        self.call("Input.insertText", &json!({"text": text}));
    }

    /// Fingers on the screen, from where they were to where they are.
    pub(super) fn touch(&mut self, kind: &str, fingers: &[[f64; 2]]) {
        let points = fingers.iter().enumerate();
        let points: Vec<Json> = points
            .map(|(id, [x, y])| json!({"x": x, "y": y, "id": id}))
            .collect();
        let event = json!({"type": kind, "touchPoints": points});
        self.call("Input.dispatchTouchEvent", &event);
    }

    /// How many pixels of the drawing have a colour.
    pub(super) fn pixels(&mut self, [red, green, blue]: [u8; 3]) -> u64 {
        let count = format!(
            "new Promise((told) => requestAnimationFrame(() => requestAnimationFrame(() => {{
                const canvas = document.getElementById('canvas');
                const {{ data }} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
                let count = 0;
                for (let i = 0; i < data.length; i += 4) {{
                    if (data[i] === {red} && data[i + 1] === {green} && data[i + 2] === {blue} && data[i + 3] === 255) count += 1;
                }}
                told(count);
            }})))"
        );
        self.value(&count).as_u64().unwrap()
    }

    /// What of the page can be reached and has no name for a screen reader.
    pub(super) fn nameless(&mut self) -> Vec<String> {
        let tree = self.call("Accessibility.getFullAXTree", &json!({}));
        let nodes = tree["nodes"].as_array().unwrap();
        let is_focusable = |node: &&Json| {
            let properties = node["properties"].as_array().into_iter().flatten();
            let mut focusable = properties.filter(|one| one["name"] == "focusable");
            node["ignored"] != true
                && node["role"]["value"] != "RootWebArea"
                && focusable.any(|one| one["value"]["value"] == true)
        };
        let focusable: Vec<&Json> = nodes.iter().filter(is_focusable).collect();
        assert!(focusable.len() > 5, "{}", focusable.len());
        let without = focusable.into_iter().filter(|node| {
            let name = node["name"]["value"].as_str().unwrap_or_default();
            name.trim().is_empty()
        });
        without.map(ToString::to_string).collect()
    }

    /// Ends the browser; the page must not have complained of anything.
    pub(super) fn close(self) {
        assert!(self.complaints.is_empty(), "{:#?}", self.complaints);
    }
}
