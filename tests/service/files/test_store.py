"""The data folder as the store."""

import pytest

from bentray_service.files.data_folder import Files

from .store_suite import StoreSuite


class TestStore(StoreSuite):
    @pytest.fixture
    def files(self, tmp_path):
        files = Files(tmp_path)
        files.prepare()
        return files

    @pytest.fixture
    def elsewhere(self, files):
        return files
