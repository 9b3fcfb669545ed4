"""`bentray projects`: the operator creates a project, changes its members and lists it."""

import json


def test_created_listed_and_changed(bentray, tmp_path):
    data = ("--tenant", "clinic", "--data", tmp_path)
    made = bentray("projects", "create", "Trial 7", "--owner", "user:alice", *data)
    project = made.stdout.strip()
    changed = bentray("projects", "member", project, "key:0123456789ab", "reader", *data)
    assert changed.stdout.splitlines() == ["user:alice owner", "key:0123456789ab reader"]
    gone = bentray("projects", "member", project, "key:0123456789ab", "none", "--json", *data)
    assert json.loads(gone.stdout)["members"] == {"user:alice": "owner"}
    listed = json.loads(bentray("projects", "list", "--json", *data).stdout)
    assert [(row["id"], row["name"], row["tenant"]) for row in listed] == [(project, "Trial 7", "clinic")]
    assert "user:alice (owner)" in bentray("projects", "list", *data).stdout
    assert json.loads(bentray("projects", "list", "--json", "--data", tmp_path).stdout) == []


def test_what_is_refused(bentray, tmp_path):
    data = ("--data", tmp_path)
    project = bentray("projects", "create", "One", "--owner", "user:alice", *data).stdout.strip()
    for words, message in (
        (("create", "Two", "--owner", "bob"), "owner: found 'bob'"),
        (("create", "", "--owner", "user:bob"), "name: found ''"),
        (("member", project, "user:bob", "king"), "role: found 'king'"),
        (("member", project, "user:alice", "none"), "no owner left"),
        (("member", "project-x", "user:bob", "reader"), "project: found 'project-x'"),
    ):
        assert message in bentray("projects", *words, *data, code=2).stderr
