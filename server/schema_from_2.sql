-- A queue of version 2 becomes one of version 3. What ran was held by a worker that is no more.
ALTER TABLE jobs ADD COLUMN worker TEXT;
ALTER TABLE jobs ADD COLUMN beats INTEGER NOT NULL DEFAULT 0;
DROP INDEX IF EXISTS jobs_of_owner;
UPDATE jobs SET status = 'queued', started = NULL, progress = 0, told = '{}' WHERE status = 'running';
