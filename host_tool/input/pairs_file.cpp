#include "host_tool/input/pairs_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <sstream>

#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/input/csv_cells.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/try.h"
#include "stitch/interchange/export.h"
#include "stitch/interchange/import.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;
using registration::PointPair;

constexpr const char* kColumns = "head_a,x_a,y_a,head_b,x_b,y_b";

Result<std::size_t> head_of(const std::string& name, const Calibration& rig) {
  const auto found = std::ranges::find(rig.heads, name, &HeadCalibration::name);
  if (found == rig.heads.end()) return fail(Errc::kBadValue, "the calibration has no head '" + name + "'");
  return static_cast<std::size_t>(found - rig.heads.begin());
}

Result<PointPair> pair_of(const std::vector<std::string>& cells, const Calibration& rig) {
  if (cells.size() != 6) return fail(Errc::kBadFormat, fmt::format("{} fields; {} has six", cells.size(), kColumns));
  const Result<std::size_t> a = head_of(cells[0], rig), b = head_of(cells[3], rig);
  if (!a) return fail(a.error());
  if (!b) return fail(b.error());
  if (*a == *b) return fail(Errc::kBadValue, "both points are of head '" + cells[0] + "'");
  std::array<double, 4> at{};
  const std::array<std::size_t, 4> places{1, 2, 4, 5};
  for (std::size_t k = 0; k < 4; ++k) {
    NODAL_TRY_ASSIGN(const double value, csv_number(cells[places[k]]));
    at[k] = value;
  }
  return PointPair{*a, {at[0], at[1]}, *b, {at[2], at[3]}};
}

Result<std::vector<PointPair>> pairs_of_project(const std::string& text, const Calibration& rig) {
  NODAL_TRY_ASSIGN(const interchange::ImportResult project, interchange::import_project(text, "pairs"));
  if (project.calibration.heads.size() != rig.heads.size()) {
    return fail(Errc::kHeadMismatch, fmt::format("it has {} images, the calibration {} heads; both must be of one rig, "
                                                 "in one order",
                                                 project.calibration.heads.size(), rig.heads.size()));
  }
  std::vector<PointPair> pairs;
  for (const interchange::ControlPoint& point : project.control_points) {
    if (point.head_a == point.head_b) continue;  // a point of a straight line
    pairs.push_back({point.head_a, point.pixel_a, point.head_b, point.pixel_b});
  }
  return pairs;
}

// Returns the program's exit code; discards its output.
Result<int> run_quietly(const std::vector<std::string>& command) {
  std::vector<char*> argv;
  argv.reserve(command.size() + 1);
  for (const std::string& word : command) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  pid_t process = 0;
  const int error = posix_spawnp(&process, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT) {
    return fail(Errc::kNotFound, "there is no " + command[0] +
                                     "; install Hugin's tools (Debian: hugin-tools), or give "
                                     "point pairs by --pairs");
  }
  if (error != 0) return fail(Errc::kIo, fmt::format("{} does not start: error {}", command[0], error));
  int status = 0;
  while (waitpid(process, &status, 0) < 0 && errno == EINTR) {
    if (interrupted()) kill(process, SIGTERM);
  }
  if (interrupted()) return fail(Errc::kCancelled, "stopped by a signal while " + command[0] + " ran");
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

// A temporary folder that the destructor removes.
class Workshop {
 public:
  Workshop() {
    std::string name = (fs::temp_directory_path() / "nodal-pairs-XXXXXX").string();
    if (mkdtemp(name.data()) != nullptr) folder_ = name;
  }
  ~Workshop() {
    std::error_code ignored;
    if (!folder_.empty()) fs::remove_all(folder_, ignored);
  }
  Workshop(const Workshop&) = delete;
  Workshop& operator=(const Workshop&) = delete;
  bool good() const { return !folder_.empty(); }
  std::string file(const char* name) const { return (folder_ / name).string(); }

 private:
  fs::path folder_;
};

}  // namespace

Result<std::vector<PointPair>> parse_pairs_csv(const std::string& text, const Calibration& rig) {
  std::vector<PointPair> pairs;
  std::istringstream in(text);
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    const std::vector<std::string> cells = csv_cells(line);
    if (cells.empty() || (cells.size() == 1 && cells[0].empty()) || cells[0].starts_with('#')) continue;
    if (cells[0] == "head_a") continue;
    const Result<PointPair> pair = pair_of(cells, rig);
    if (!pair) return fail(pair.error().in(fmt::format("line {}", number)));
    pairs.push_back(*pair);
  }
  return pairs;
}

Result<std::vector<PointPair>> read_pairs(const std::string& file, const Calibration& rig) {
  NODAL_TRY_ASSIGN(const std::string text, read_file(file, interchange::kMaxProjectBytes));
  const bool project = has_ending(file, ".pto") || has_ending(file, ".pts") || has_ending(file, ".ptv");
  Result<std::vector<PointPair>> pairs = project ? pairs_of_project(text, rig) : parse_pairs_csv(text, rig);
  if (!pairs) return fail(pairs.error().in(file));
  if (pairs->size() > kMaxPointPairs) {
    return fail(Errc::kTooLarge, fmt::format("{}: {} point pairs; at most {} are fitted, so leave some out", file,
                                             pairs->size(), kMaxPointPairs));
  }
  if (pairs->empty()) {
    return fail(Errc::kMissingField,
                file + ": no point pairs; a line of CSV is " + kColumns + ", a project's are its control points");
  }
  return pairs;
}

std::string pairs_csv(const std::vector<PointPair>& pairs, const Calibration& rig) {
  std::string text = std::string(kColumns) + "\n";
  for (const PointPair& pair : pairs) {
    text += fmt::format("{},{:.4f},{:.4f},{},{:.4f},{:.4f}\n", rig.heads[pair.head_a].name, pair.pixel_a.x,
                        pair.pixel_a.y, rig.heads[pair.head_b].name, pair.pixel_b.x, pair.pixel_b.y);
  }
  return text;
}

Result<std::vector<PointPair>> find_pairs(const std::vector<std::string>& pictures, const Calibration& rig) {
  if (pictures.size() != rig.heads.size()) {
    return fail(Errc::kBadValue,
                fmt::format("{} pictures for {} heads; give one of each head, in the calibration's order",
                            pictures.size(), rig.heads.size()));
  }
  const Workshop workshop;
  if (!workshop.good()) return fail(Errc::kIo, "no folder for temporary files");
  // cpfind undoes the lenses before it searches for features, so approximate lenses are sufficient.
  interchange::ExportOptions options;
  for (const std::string& picture : pictures) options.images.push_back(fs::absolute(picture).string());
  const auto project = interchange::export_calibration(rig, interchange::ExportFormat::kHugin, options);
  if (!project) return fail(project.error().in("for cpfind"));
  const std::string in = workshop.file("in.pto"), out = workshop.file("out.pto");
  NODAL_TRY(write_file(in, project->files.front().text));
  NODAL_TRY_ASSIGN(const int code, run_quietly({"cpfind", "--fullscale", "-o", out, in}));
  if (code != 0) return fail(Errc::kNotDetermined, fmt::format("cpfind failed with code {}", code));
  Result<std::vector<PointPair>> pairs = read_pairs(out, rig);
  if (!pairs && pairs.error().code == Errc::kMissingField) {
    return fail(Errc::kNotDetermined, "cpfind finds nothing that two heads share; give point pairs by hand (--pairs)");
  }
  return pairs;
}

}  // namespace nodal::host
