"""A long ride with recording and viewers: memory, cycles, records, logs, and the report of its bag."""
