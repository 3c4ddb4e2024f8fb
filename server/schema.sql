-- The queue in SQLite: one row a job, in the order in which the jobs came. Times are milliseconds since 1970 (UTC).
CREATE TABLE IF NOT EXISTS jobs (
  sequence INTEGER PRIMARY KEY AUTOINCREMENT,
  id       TEXT    NOT NULL UNIQUE,                   -- 32 hexadecimal digits, the name of the job's folder
  status   TEXT    NOT NULL CHECK (status IN ('queued', 'running', 'succeeded', 'failed', 'canceled')),
  scene    TEXT    NOT NULL,                          -- the scene's file, relative to the job's folder
  crashes  INTEGER NOT NULL DEFAULT 0,                -- attempts that ended without an answer
  progress REAL    NOT NULL DEFAULT 0,                -- 0 to 1, as last written down
  created  INTEGER NOT NULL,
  started  INTEGER,                                   -- of the newest attempt
  ended    INTEGER,
  problem  TEXT,                                      -- why it failed: problem details (RFC 9457) as JSON
  owner    TEXT    NOT NULL DEFAULT '',               -- whose job it is
  attempt  INTEGER NOT NULL DEFAULT 0,                -- how often it was taken by a worker
  told     TEXT    NOT NULL DEFAULT '{}',             -- phase and statistics, as last written down: JSON
  expires  INTEGER,                                   -- when an ended job is forgotten
  worker   TEXT,                                      -- who holds it while it runs
  beats    INTEGER NOT NULL DEFAULT 0                 -- signs of life of those who held it
) STRICT;

CREATE INDEX IF NOT EXISTS jobs_to_do ON jobs (sequence) WHERE status IN ('queued', 'running');
CREATE INDEX IF NOT EXISTS jobs_by_owner ON jobs (owner, sequence);
CREATE INDEX IF NOT EXISTS jobs_to_forget ON jobs (expires) WHERE expires IS NOT NULL;

-- Idempotency keys, with a digest of the payload that each came with first.
CREATE TABLE IF NOT EXISTS keys (
  owner   TEXT    NOT NULL,
  key     TEXT    NOT NULL,
  digest  TEXT    NOT NULL,
  job     TEXT    NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  created INTEGER NOT NULL,
  PRIMARY KEY (owner, key)
) STRICT;

CREATE INDEX IF NOT EXISTS keys_of_job ON keys (job);

-- When a worker took a job of an owner's last.
CREATE TABLE IF NOT EXISTS turns (
  owner TEXT    NOT NULL PRIMARY KEY,
  taken INTEGER NOT NULL              -- counts the jobs that were taken, of all owners
) STRICT;
