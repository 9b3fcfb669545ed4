"""Requirements on every file store; the tests of each store inherit it."""

import pytest

from bentray_service.files.data_folder import Files
from bentray_service.rows.ids import LOCAL, Tenant, new_id

OTHER = Tenant("other.one+2@clinic")


class StoreSuite:
    """A class that inherits it has two fixtures.

    ``files``: the data folder of a service with the store. ``elsewhere``: that of another service with the
    same one, which may be the same folder.
    """

    def file(self, files, content=b"abc", tenant=LOCAL):
        """A dataset that is published."""
        path = files.of(tenant).dataset(new_id("dataset"))
        path.write_bytes(content)
        files.store.publish(path)
        return path

    def folder(self, files):
        path = files.of(LOCAL).field("field-" + "0" * 20)
        path.mkdir()
        (path / "outer.npy").write_bytes(b"outer")
        (path / "layout.json").write_bytes(b"{}")
        files.store.publish(path)
        return path

    def there(self, files: Files, path, tenant=LOCAL):
        """The same thing in another data folder."""
        return files.of(tenant).root / path.parent.name / path.name

    @pytest.mark.parametrize("content", [b"", b"abc", bytes(range(256)) * 999])
    def test_a_file_is_the_same_everywhere(self, files, elsewhere, content):
        path = self.file(files, content)
        brought = elsewhere.store.fetch(self.there(elsewhere, path))
        assert brought.read_bytes() == content
        # The tags of downloads are made of it.
        assert brought.stat().st_mtime_ns == path.stat().st_mtime_ns
        assert files.store.fetch(path) == path

    def test_so_is_a_folder(self, files, elsewhere):
        path = self.folder(files)
        brought = elsewhere.store.fetch(self.there(elsewhere, path))
        assert {one.name: one.read_bytes() for one in brought.iterdir()} == {
            "outer.npy": b"outer",
            "layout.json": b"{}",
        }

    def test_last_publication_wins(self, files, elsewhere):
        path = self.file(files)
        path.write_bytes(b"made anew")
        for _ in range(2):
            files.store.publish(path)
        assert elsewhere.store.fetch(self.there(elsewhere, path)).read_bytes() == b"made anew"

    def test_missing_objects_are_not_found(self, files):
        files.of(LOCAL).root.mkdir(parents=True, exist_ok=True)
        with pytest.raises(FileNotFoundError):
            files.store.fetch(files.of(LOCAL).dataset(new_id("dataset")))

    def test_removal_affects_only_its_object(self, files, elsewhere):
        gone, folder, kept = self.file(files), self.folder(files), self.file(files)
        never = files.of(LOCAL).mesh(new_id("mesh"))
        files.store.remove([gone, folder, never])
        for path in (gone, folder):
            assert not path.exists()
            with pytest.raises(FileNotFoundError):
                elsewhere.store.fetch(self.there(elsewhere, path))
        assert elsewhere.store.fetch(self.there(elsewhere, kept)).read_bytes() == b"abc"

    def test_tenants_are_isolated(self, files, elsewhere):
        path = self.file(files, b"mine")
        theirs = self.there(files, path, OTHER)
        with pytest.raises(FileNotFoundError):
            files.store.fetch(theirs)
        theirs.write_bytes(b"theirs")
        files.store.publish(theirs)
        files.store.remove([path])
        assert elsewhere.store.fetch(self.there(elsewhere, path, OTHER)).read_bytes() == b"theirs"

    def test_store_passes_its_check(self, files):
        assert files.store.fault() is None
        path = self.file(files)
        files.store.tidy(lambda: False)
        assert path.read_bytes() == b"abc"
