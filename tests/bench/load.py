#!/usr/bin/env python3
"""What radbaked bears, measured: status requests while two bakes run (by wrk), memory over 10,000 requests, memory over a
256 MB upload, and 1,000 jobs from queue to end; with --database the last two in PostgreSQL too, and two workers beside
one, each on a core of its own. Says each figure; ends with 1 where memory grows more than it may or a job is lost.

    tests/bench/load.py [--programs build/release/bin] [--connections 500] [--seconds 20] [--database postgresql://…]

The database must be empty; it is left with jobs that are forgotten in a day.
"""
import argparse
import http.client
import json
import os
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
MOST_GROWTH_OVER_REQUESTS = 4 << 20
MOST_GROWTH_OVER_UPLOAD = 32 << 20
UPLOAD = 256 << 20
JOBS = 1000
SHARED_JOBS = 200


class Service:
    """A radbaked of its own, in a folder of its own."""

    def __init__(self, programs, *flags, workers=2, core=None):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="radbaked-load-"))
        self.log = open(self.folder / "log", "wb")
        self.process = subprocess.Popen(
            [programs / "radbaked", "--listen", "127.0.0.1:0", "--data", self.folder / "data", "--workers",
             str(workers), "--grace", "0s", *flags], stdout=subprocess.PIPE, stderr=self.log, text=True,
            preexec_fn=None if core is None else lambda: os.sched_setaffinity(0, {core}))
        self.url = self.process.stdout.readline().removeprefix("listening on ").strip()
        self.address = self.url.removeprefix("http://")
        if not self.url:
            sys.exit(f"load: radbaked does not start: {(self.folder / 'log').read_text()}")

    def stop(self):
        self.process.terminate()
        self.process.wait()
        self.log.close()
        shutil.rmtree(self.folder)

    def ask(self, method, path, body=None, headers=None):
        connection = http.client.HTTPConnection(self.address, timeout=60)
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        text = answer.read()
        connection.close()
        return answer.status, text

    def bake(self, scene, parameters):
        """Posts a scene; the path of its job."""
        form = (b'--b\r\nContent-Disposition: form-data; name="parameters"\r\n\r\n' + json.dumps(parameters).encode() +
                b'\r\n--b\r\nContent-Disposition: form-data; name="scene"\r\n\r\n' + scene.read_bytes() + b"\r\n--b--\r\n")
        status, text = self.ask("POST", "/v1/bakes", form, {"Content-Type": "multipart/form-data; boundary=b"})
        if status != 202:
            sys.exit(f"load: the service does not take the scene: {text.decode()}")
        return json.loads(text)["links"]["self"]

    def memory(self, what):
        """VmRSS (now) or VmHWM (the most ever), in bytes."""
        text = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(rf"{what}:\s+(\d+) kB", text)[1]) * 1024


def wait_until_running(service, jobs):
    deadline = time.monotonic() + 60
    while any(json.loads(service.ask("GET", job)[1])["status"] != "running" for job in jobs):
        if time.monotonic() > deadline:
            sys.exit("load: the two bakes do not run")
        time.sleep(0.1)


def status_requests(service, connections, seconds):
    scene = ROOT / "scenes/cornell-box.glb"
    jobs = [service.bake(scene, {"error": 0.001, "check": 0}) for _ in range(2)]
    wait_until_running(service, jobs)
    said = subprocess.run(["wrk", "-t", "2", "-c", str(connections), "-d", f"{seconds}s", "--latency", "--timeout", "30s",
                           service.url + jobs[0]], capture_output=True, text=True, check=True).stdout
    still = [json.loads(service.ask("GET", job)[1])["status"] for job in jobs]
    rate = float(re.search(r"Requests/sec:\s+([\d.]+)", said)[1])
    quantile = lambda share: re.search(rf"{share}%\s+(\S+)", said)[1]
    print(f"status: {rate:.0f} requests a second by {connections} connections while two bakes run (then {still[0]} and "
          f"{still[1]}); p50 {quantile(50)}, p99 {quantile(99)}")
    for line in re.findall(r"(?:Socket errors|Non-2xx).*", said):
        print(f"status: {line}")
    for job in jobs:
        service.ask("DELETE", job)
    return "Non-2xx" not in said


def many_requests(service):
    job = service.bake(ROOT / "scenes/furnace-box.glb", {"error": 0.2, "check": 0})
    seen = []
    for i in range(10_000):
        path = (job, "/v1/bakes", "/metrics", job + "/statistics", "/nothing")[i % 5]
        service.ask("GET", path)
        if i % 1000 == 999:
            seen.append(service.memory("VmRSS"))
    growth = seen[-1] - seen[0]
    print(f"requests: 10,000; memory after 1,000: {seen[0] / 2**20:.1f} MB, after all: {seen[-1] / 2**20:.1f} MB")
    return growth <= MOST_GROWTH_OVER_REQUESTS


def large_upload(service):
    glb = service.folder / "large.glb"
    with open(glb, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, UPLOAD))
        file.truncate(UPLOAD)
    before = service.memory("VmHWM")
    begin = time.monotonic()
    status = subprocess.run(["curl", "-sS", "-o", service.folder / "answer", "-w", "%{http_code}", "-X", "POST", "-T", glb,
                             "-H", "Content-Type: model/gltf-binary", "-H", "Expect:", service.url + "/v1/bakes"],
                            capture_output=True, text=True, check=True).stdout
    seconds = time.monotonic() - begin
    growth = service.memory("VmHWM") - before
    print(f"upload: {UPLOAD >> 20} MB in {seconds:.1f} s: {status}; memory grew by {growth / 2**20:.1f} MB")
    return status == "202" and growth <= MOST_GROWTH_OVER_UPLOAD


def queue_jobs(service, count):
    """Posts small jobs, one after the other; how many seconds that took."""
    begin = time.monotonic()
    for _ in range(count):
        service.bake(ROOT / "scenes/furnace-box.glb", {"error": 0.3, "check": 0})
    return time.monotonic() - begin


def count_jobs(service):
    """How many jobs there are in each state."""
    text = service.ask("GET", "/metrics")[1].decode()
    count = lambda state: int(re.search(rf'radbaked_jobs{{state="{state}"}} (\d+)', text)[1])
    return {state: count(state) for state in ("queued", "running", "succeeded", "failed")}


def wait_until_ended(service, before):
    """Until all have ended; how many have succeeded since, and in how many seconds."""
    begin = time.monotonic()
    while (now := count_jobs(service))["queued"] + now["running"] > 0:
        time.sleep(0.05)
    return now["succeeded"] - before["succeeded"], time.monotonic() - begin


def many_jobs(service):
    before = count_jobs(service)
    queued = queue_jobs(service, JOBS)
    done, more = wait_until_ended(service, before)
    print(f"jobs: {JOBS:,} queued in {queued:.1f} s, {done:,} succeeded after {queued + more:.1f} s; memory at most "
          f"{service.memory('VmHWM') / 2**20:.1f} MB")
    return done == JOBS


def shared_jobs(programs, database):
    """The same jobs by one worker and by two."""
    rates = []
    for workers in (1, 2):
        api = Service(programs, "--role", "api", "--database", database)
        before = count_jobs(api)
        queue_jobs(api, SHARED_JOBS)
        begin = time.monotonic()
        running = [Service(programs, "--role", "worker", "--database", database, workers=1, core=core)
                   for core in range(workers)]
        done, _ = wait_until_ended(api, before)
        rates.append(done / (time.monotonic() - begin))
        shares = [re.search(r'outcome="baked"} (\d+)', one.ask("GET", "/metrics")[1].decode()) for one in running]
        print(f"shared: {done} of {SHARED_JOBS} jobs by {workers} workers, {rates[-1]:.1f} a second; each took "
              f"{' and '.join(share[1] if share else '0' for share in shares)}")
        for service in [api, *running]:
            service.stop()
    print(f"shared: two workers are {rates[1] / rates[0]:.2f} times as fast as one")
    return done == SHARED_JOBS


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", type=pathlib.Path, default=ROOT / "build/release/bin")
    parser.add_argument("--connections", type=int, default=500)
    parser.add_argument("--seconds", type=int, default=20)
    parser.add_argument("--database")
    arguments = parser.parse_args()
    for tool in ("wrk", "curl"):
        if shutil.which(tool) is None:
            sys.exit(f"load: {tool} is not there: run 'deploy/install load' first")
    good = True
    programs = arguments.programs.resolve()
    kept = ["--database", arguments.database] if arguments.database else []
    # A service each: the memory that one has taken says nothing of the others.
    for measure, flags in ((lambda service: status_requests(service, arguments.connections, arguments.seconds), []),
                           (many_requests, []), (large_upload, []), (many_jobs, []),
                           *([(large_upload, kept), (many_jobs, kept)] if kept else [])):
        service = Service(programs, *flags)
        if flags:
            print("in PostgreSQL:")
        try:
            good = measure(service) and good
        finally:
            service.stop()
    if kept:
        good = shared_jobs(programs, arguments.database) and good
    sys.exit(0 if good else 1)


main()
