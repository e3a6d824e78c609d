//! Chromium without a screen, told what to do over its debugging pipe: JSON messages that end in a zero byte.

use crate::support::skipped;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// WebGPU through the browser's own software device.
const FLAGS: [&str; 15] = [
    "--headless",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--remote-debugging-pipe",
    "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
];

/// A browser with one page.
pub struct Browser {
    child: Child,
    replies: BufReader<ChildStdout>,
    number: u64,
    session: String,
    /// Messages in the page's console, and what went wrong in it.
    problems: Vec<String>,
    _profile: tempfile::TempDir,
}

/// Where the browser is, if there is one.
fn program() -> Option<PathBuf> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let folders = std::env::var_os("PATH")?;
    let all = std::env::split_paths(&folders).flat_map(|f| names.map(|name| f.join(name)));
    all.into_iter().find(|path| path.is_file())
}

impl Browser {
    /// A browser of this size that shows `address`; none, said aloud, where there is no browser.
    pub fn open(address: &str, size: [u32; 2]) -> Option<Self> {
        let Some(program) = program() else {
            skipped("there is no chromium in PATH (apt install chromium)");
            return None;
        };
        let profile = tempfile::tempdir().unwrap();
        let mut child = Command::new("sh")
            .args(["-c", "exec \"$@\" 3<&0 4>&1 1>/dev/null", "sh"])
            .arg(program)
            .args(FLAGS)
            .arg(format!("--window-size={},{}", size[0], size[1]))
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let replies = BufReader::new(child.stdout.take().unwrap());
        let (session, problems) = (String::new(), Vec::new());
        let mut browser =
            Browser { child, replies, number: 0, session, problems, _profile: profile };
        browser.attach();
        browser.call("Page.navigate", &json!({ "url": address }));
        Some(browser)
    }

    fn attach(&mut self) {
        let target = self.call("Target.createTarget", &json!({ "url": "about:blank" }));
        let target = json!({ "targetId": target["targetId"], "flatten": true });
        let attached = self.call("Target.attachToTarget", &target);
        self.session = attached["sessionId"].as_str().unwrap().to_owned();
        for domain in ["Page", "Runtime", "Log"] {
            self.call(&format!("{domain}.enable"), &json!({}));
        }
    }

    /// The result of a command of the debugging protocol.
    pub fn call(&mut self, method: &str, parameters: &Value) -> Value {
        self.number += 1;
        let mut message = json!({ "id": self.number, "method": method, "params": parameters });
        if !self.session.is_empty() {
            message["sessionId"] = json!(self.session);
        }
        let pipe = self.child.stdin.as_mut().unwrap();
        pipe.write_all(format!("{message}\0").as_bytes()).unwrap();
        pipe.flush().unwrap();
        loop {
            let reply = self.receive();
            if reply["id"] == json!(self.number) {
                assert!(reply.get("error").is_none(), "{method}: {reply}");
                return reply["result"].clone();
            }
            let event = reply["method"].as_str().unwrap_or_default();
            if ["Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded"]
                .contains(&event)
            {
                self.problems.push(reply["params"].to_string());
            }
        }
    }

    fn receive(&mut self) -> Value {
        let mut bytes = Vec::new();
        self.replies.read_until(0, &mut bytes).unwrap();
        assert_eq!(bytes.pop(), Some(0), "the browser has ended");
        serde_json::from_slice(&bytes).unwrap()
    }

    /// The value of an expression, whose promise is awaited.
    pub fn value(&mut self, expression: &str) -> Value {
        let asked =
            json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let found = self.call("Runtime.evaluate", &asked);
        assert!(found.get("exceptionDetails").is_none(), "{expression}: {found}");
        found["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub fn wait(&mut self, expression: &str) {
        let start = Instant::now();
        while self.value(expression) != json!(true) {
            let told = "document.getElementById('told')?.textContent ?? ''";
            if start.elapsed() > Duration::from_secs(240) {
                panic!(
                    "{expression} is not so after four minutes; the page says {}",
                    self.value(told)
                );
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Returns the screen of the browser.
    pub fn screen(&mut self) -> image::RgbImage {
        let shot = self.call("Page.captureScreenshot", &json!({ "format": "png" }));
        let png = base64::decode(shot["data"].as_str().unwrap()).unwrap();
        image::load_from_memory(&png).unwrap().into_rgb8()
    }

    /// Returns the messages in the page's console, and what went wrong in it.
    pub fn problems(&mut self) -> &[String] {
        // Whatever has happened so far is told before this is answered.
        self.value("0");
        &self.problems
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The address of a file.
pub fn address(path: &Path) -> String {
    format!("file://{}", path.display())
}
