-- The queue in PostgreSQL: one row a job, in the order in which the jobs came. Times are milliseconds since 1970 (UTC).
CREATE TABLE jobs (
  sequence bigint  GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  id       text    NOT NULL UNIQUE,                -- 32 hexadecimal digits
  status   text    NOT NULL CHECK (status IN ('queued', 'running', 'succeeded', 'failed', 'canceled')),
  scene    text    NOT NULL,                       -- the scene's file, by its name among the job's files
  crashes  integer NOT NULL DEFAULT 0,             -- attempts that ended without an answer
  progress double precision NOT NULL DEFAULT 0,    -- 0 to 1, as last written down
  created  bigint  NOT NULL,
  started  bigint,                                 -- of the newest attempt
  ended    bigint,
  problem  text,                                   -- why it failed: problem details (RFC 9457) as JSON
  owner    text    NOT NULL DEFAULT '',            -- whose job it is
  attempt  integer NOT NULL DEFAULT 0,             -- how often it was taken by a worker
  told     text    NOT NULL DEFAULT '{}',          -- phase and statistics, as last written down: JSON
  expires  bigint,                                 -- when an ended job is forgotten
  worker   text,                                   -- who holds it while it runs
  beats    bigint  NOT NULL DEFAULT 0              -- signs of life of those who held it
);

CREATE INDEX jobs_to_do ON jobs (sequence) WHERE status IN ('queued', 'running');
CREATE INDEX jobs_by_owner ON jobs (owner, sequence);
CREATE INDEX jobs_to_forget ON jobs (expires) WHERE expires IS NOT NULL;

-- The files of jobs, in pieces: the upload is attempt 0, a result that of the attempt that made it.
CREATE TABLE pieces (
  job     text    NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  attempt integer NOT NULL,
  name    text    NOT NULL,                        -- a path relative to the job's folder
  number  integer NOT NULL,                        -- from 0; all pieces but a file's last have the same size
  bytes   bytea   NOT NULL,
  PRIMARY KEY (job, attempt, name, number)
);
-- Scenes do not compress well enough to be worth the time.
ALTER TABLE pieces ALTER COLUMN bytes SET STORAGE EXTERNAL;

-- Idempotency keys, with a digest of the payload that each came with first.
CREATE TABLE keys (
  owner   text   NOT NULL,
  key     text   NOT NULL,
  digest  text   NOT NULL,
  job     text   NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  created bigint NOT NULL,
  PRIMARY KEY (owner, key)
);

CREATE INDEX keys_of_job ON keys (job);

-- When a worker took a job of an owner's last.
CREATE TABLE turns (
  owner text   NOT NULL PRIMARY KEY,
  taken bigint NOT NULL                            -- counts the jobs that were taken, of all owners
);
CREATE SEQUENCE takings;

CREATE TABLE version (number integer NOT NULL);
INSERT INTO version VALUES (1);
