-- The queue: one row a job, in the order in which the jobs came. Times are milliseconds since 1970 (UTC).
CREATE TABLE IF NOT EXISTS jobs (
  sequence INTEGER PRIMARY KEY AUTOINCREMENT,
  id       TEXT    NOT NULL UNIQUE,                   -- 32 hexadecimal digits, the name of the job's folder
  status   TEXT    NOT NULL CHECK (status IN ('queued', 'running', 'succeeded', 'failed', 'canceled')),
  scene    TEXT    NOT NULL,                          -- the scene's file, relative to the job's folder
  crashes  INTEGER NOT NULL DEFAULT 0,                -- children that ended without an answer
  progress REAL    NOT NULL DEFAULT 0,                -- 0 to 1, when it ended
  created  INTEGER NOT NULL,
  started  INTEGER,                                   -- of the newest attempt
  ended    INTEGER,
  problem  TEXT                                       -- why it failed: problem details (RFC 9457) as JSON
) STRICT;

CREATE INDEX IF NOT EXISTS jobs_to_do ON jobs (sequence) WHERE status IN ('queued', 'running');
