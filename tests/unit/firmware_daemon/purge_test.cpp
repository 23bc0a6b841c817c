// What `apt purge nodald` leaves.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>

namespace nodal::daemon {
namespace {

namespace fs = std::filesystem;

void make(const fs::path& file) {
  fs::create_directories(file.parent_path());
  std::ofstream(file) << "x";
}

TEST(Package, Purged_KeepsTakesWhereverTheyAreAndNothingElse) {
  std::string name = fs::temp_directory_path() / "nodal-purge-XXXXXX";
  ASSERT_NE(::mkdtemp(name.data()), nullptr);
  const fs::path root = name;
  for (const char* file :
       {"var/lib/nodal/settings", "var/lib/nodal/calibrations/0123.json", "etc/nodal/rig.toml", "run/nodal/x",
        "etc/nodal/a file", "var/lib/nodal/takes/000001/take.json", "var/lib/nodal/takes/000001/cam0-0000.mkv",
        "var/lib/nodal/takes/next-take", "var/lib/nodal/elsewhere/film.mkv", "outside/film.mkv"}) {
    make(root / file);
  }
  fs::create_directory_symlink(root / "outside", root / "var/lib/nodal/link");
  const std::string command =
      "DPKG_ROOT='" + root.string() + "' sh '" NODAL_SOURCE_DIR "/firmware/daemon/debian/postrm' purge >/dev/null 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0);
  std::set<std::string> left;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    if (!entry.is_directory()) left.insert(fs::relative(entry.path(), root).string());
  }
  EXPECT_EQ(left, (std::set<std::string>{"outside/film.mkv", "var/lib/nodal/takes/000001/cam0-0000.mkv",
                                         "var/lib/nodal/takes/000001/take.json", "var/lib/nodal/takes/next-take"}));
  fs::remove_all(root);
}

}  // namespace
}  // namespace nodal::daemon
