//! Chromium without a window, by the W3C WebDriver protocol as `chromedriver` speaks it.

use std::{
    env,
    io::{BufRead, BufReader, Write},
    path::Path,
    process::{Child, ChildStdout, Command, Stdio},
    sync::{Mutex, MutexGuard},
};

use base64::{Engine, engine::general_purpose::STANDARD};
use serde_json::{Value, json};
use tempfile::TempDir;

/// Keys without a character, as WebDriver has them.
pub mod keys {
    pub const END: &str = "\u{e010}";
    pub const HOME: &str = "\u{e011}";
    pub const LEFT: &str = "\u{e012}";
    pub const RIGHT: &str = "\u{e014}";
}

/// A key of the JSON object that stands for an element.
const ELEMENT: &str = "element-6066-11e4-a52e-4f735466cecf";

/// One browser at a time: each draws in software, on every core.
static ALONE: Mutex<()> = Mutex::new(());

pub struct Browser {
    session: String,
    driver: Child,
    /// The driver would stop if nobody listened.
    _output: BufReader<ChildStdout>,
    _profile: TempDir,
    _alone: MutexGuard<'static, ()>,
}

impl Browser {
    /// `None`, with a line on the terminal, where there is no browser and none is required.
    pub fn start() -> Option<Self> {
        let alone = ALONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let started = Command::new("chromedriver")
            .arg("--port=0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let mut driver = match started {
            Ok(driver) => driver,
            Err(error) => {
                let required = env::var_os("PBA_REQUIRE_BROWSER").is_some();
                assert!(!required, "chromedriver does not start: {error}");
                // Past the test harness, which would keep it to itself.
                let _ = writeln!(
                    std::io::stderr(),
                    "SKIPPED: the report is not tested, chromedriver does not start: {error}"
                );
                return None;
            }
        };
        let mut output = BufReader::new(driver.stdout.take().unwrap());
        let driver_at = format!("http://127.0.0.1:{}", port(&mut output));
        let profile = TempDir::new().unwrap();
        let mut arguments = [
            "--headless=new",
            "--no-sandbox",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            "--window-size=1100,760",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
        ]
        .map(String::from)
        .to_vec();
        arguments.push(format!("--user-data-dir={}", profile.path().display()));
        let capabilities = json!({ "capabilities": { "alwaysMatch": {
            "browserName": "chrome",
            "goog:chromeOptions": { "args": arguments },
            "goog:loggingPrefs": { "browser": "ALL" },
        } } });
        let session = request(minreq::post(format!("{driver_at}/session")), Some(capabilities));
        let id = session["sessionId"].as_str().expect("a session");
        Some(Self {
            session: format!("{driver_at}/session/{id}"),
            driver,
            _output: output,
            _profile: profile,
            _alone: alone,
        })
    }

    pub fn open(&self, page: &Path) {
        let path = page.to_str().unwrap().replace('<', "%3C").replace(' ', "%20");
        self.post("/url", json!({ "url": format!("file://{path}") }));
    }

    /// What a script returns, or what its promise comes to.
    pub fn run(&self, script: &str) -> Value {
        self.post("/execute/sync", json!({ "script": script, "args": [] }))
    }

    pub fn click(&self, selector: &str) {
        // Radio buttons lie under what stands for them.
        self.run(&format!("document.querySelector('{selector}').click()"));
    }

    /// Gives an element the focus, and presses keys.
    pub fn press(&self, selector: &str, text: &str) {
        self.run(&format!("document.querySelector('{selector}').focus()"));
        let keys = text.chars().flat_map(|key| {
            ["keyDown", "keyUp"].map(|kind| json!({ "type": kind, "value": key.to_string() }))
        });
        let keys: Vec<Value> = keys.collect();
        self.post(
            "/actions",
            json!({ "actions": [{ "type": "key", "id": "keyboard", "actions": keys }] }),
        );
    }

    /// Drags from the middle of an element, by some pixels.
    pub fn drag(&self, selector: &str, right: i64, down: i64) {
        let origin = json!({ ELEMENT: self.elements(selector)[0] });
        let to = |x: i64, y: i64| json!({ "type": "pointerMove", "origin": origin, "x": x, "y": y, "duration": 60 });
        let steps = [
            to(0, 0),
            json!({ "type": "pointerDown", "button": 0 }),
            to(right, down),
            json!({ "type": "pointerUp", "button": 0 }),
        ];
        self.post(
            "/actions",
            json!({ "actions": [{ "type": "pointer", "id": "mouse", "actions": steps }] }),
        );
    }

    /// A PNG of an element.
    pub fn picture(&self, selector: &str) -> Vec<u8> {
        let id = &self.elements(selector)[0];
        let picture = self.get(&format!("/element/{id}/screenshot"));
        STANDARD.decode(picture.as_str().unwrap()).unwrap()
    }

    pub fn text(&self, selector: &str) -> String {
        let id = &self.elements(selector)[0];
        self.get(&format!("/element/{id}/text")).as_str().unwrap().into()
    }

    pub fn attribute(&self, selector: &str, name: &str) -> String {
        let id = &self.elements(selector)[0];
        self.get(&format!("/element/{id}/attribute/{name}")).as_str().unwrap_or_default().into()
    }

    /// What a screen reader calls each of some elements.
    pub fn labels(&self, selector: &str) -> Vec<String> {
        let label = |id: &String| {
            self.get(&format!("/element/{id}/computedlabel")).as_str().unwrap_or_default().into()
        };
        self.elements(selector).iter().map(label).collect()
    }

    /// Errors on the console since this was last asked.
    pub fn errors(&self) -> Vec<String> {
        let entries = self.post("/se/log", json!({ "type": "browser" }));
        let errors = entries.as_array().unwrap().iter().filter(|entry| entry["level"] == "SEVERE");
        errors.map(|entry| entry["message"].to_string()).collect()
    }

    /// The colour scheme that the reader prefers.
    pub fn prefer(&self, scheme: &str) {
        let features = json!([{ "name": "prefers-color-scheme", "value": scheme }]);
        self.devtools("Emulation.setEmulatedMedia", json!({ "features": features }));
    }

    /// A phone's screen of this size.
    pub fn size(&self, width: u32, height: u32) {
        let screen =
            json!({ "width": width, "height": height, "deviceScaleFactor": 2, "mobile": true });
        self.devtools("Emulation.setDeviceMetricsOverride", screen);
    }

    fn devtools(&self, command: &str, parameters: Value) {
        self.post("/goog/cdp/execute", json!({ "cmd": command, "params": parameters }));
    }

    fn elements(&self, selector: &str) -> Vec<String> {
        let found = self.post("/elements", json!({ "using": "css selector", "value": selector }));
        let ids: Vec<String> =
            found.as_array().unwrap().iter().map(|e| e[ELEMENT].as_str().unwrap().into()).collect();
        assert!(!ids.is_empty(), "nothing is {selector}");
        ids
    }

    fn post(&self, path: &str, body: Value) -> Value {
        request(minreq::post(format!("{}{path}", self.session)), Some(body))
    }

    fn get(&self, path: &str) -> Value {
        request(minreq::get(format!("{}{path}", self.session)), None)
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = minreq::delete(&self.session).send();
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}

/// The port that the driver says it has chosen.
fn port(output: &mut impl BufRead) -> u16 {
    let mut lines = output.lines().map(Result::unwrap);
    let port = lines.find_map(|line| {
        line.split_once("successfully on port ")?.1.trim_end_matches('.').parse().ok()
    });
    port.expect("the driver names its port")
}

#[track_caller]
fn request(request: minreq::Request, body: Option<Value>) -> Value {
    let request = match body {
        Some(body) => request.with_body(body.to_string()),
        None => request,
    };
    let response = request.send().unwrap();
    let mut answer: Value = serde_json::from_str(response.as_str().unwrap()).unwrap();
    assert_eq!(response.status_code, 200, "{answer}");
    answer["value"].take()
}
