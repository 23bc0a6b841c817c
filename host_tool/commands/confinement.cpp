#include "host_tool/commands/confinement.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string_view>
#include <system_error>

#include "hal/linux/confine/confine.h"
#include "hal/linux/link/link_helper.h"
#include "host_tool/child/find_program.h"
#include "host_tool/commands/look.h"
#include "host_tool/commands/render_film.h"
#include "host_tool/commands/rigs.h"
#include "host_tool/commands/stitch_film.h"
#include "host_tool/console/overwriting.h"
#include "host_tool/input/picture_masks.h"
#include "host_tool/input/project_pictures.h"
#include "host_tool/output/cube_faces.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

struct Use {
  std::string_view option;
  PathUse use;
};
constexpr std::array kUses{Use{"out", PathUse::kOutputFile},
                           Use{"csv", PathUse::kOutputFile},
                           Use{"report", PathUse::kOutputFile},
                           Use{"rig-toml", PathUse::kOutputFile},
                           Use{"svg", PathUse::kOutputFile},
                           Use{"to", PathUse::kOutputFolder},
                           Use{"thumbnails", PathUse::kOutputFolder},
                           Use{"calibration", PathUse::kInput},
                           Use{"envelope", PathUse::kInput},
                           Use{"from", PathUse::kInput},
                           Use{"images", PathUse::kInput},
                           Use{"layout", PathUse::kInput},
                           Use{"mesh", PathUse::kInput},
                           Use{"pairs", PathUse::kInput},
                           Use{"path", PathUse::kInput},
                           Use{"pattern", PathUse::kInput},
                           Use{"signature", PathUse::kInput},
                           Use{"sound", PathUse::kInput}};

/// What the C and C++ libraries read: themselves, time zones, and what the machine has.
constexpr std::array kEverywhere{
    "/usr",       "/lib",          "/lib64",        "/etc/ld.so.cache",        "/etc/localtime",
    "/proc/self", "/proc/meminfo", "/proc/cpuinfo", "/sys/devices/system/cpu", "/dev/null",
    "/dev/zero",  "/dev/urandom"};
constexpr std::string_view kStitchCommand = "stitch", kRenderCommand = "render";
constexpr std::string_view kRays = "rays:";  // prefix of a file in --layout and --from

/// Programs of other projects that a flag starts, with what they need: their folder for files of a run.
constexpr std::string_view kCpfindFlag = "cpfind";

bool is_there(const fs::path& path) {
  std::error_code error;
  return fs::exists(path, error);
}

/// The nearest folder on the way up that exists: where the first missing one would be made.
std::string existing(fs::path folder) {
  if (folder.empty()) folder = ".";
  folder = fs::absolute(folder);
  while (!is_there(folder) && folder.has_parent_path() && folder != folder.parent_path()) folder = folder.parent_path();
  return folder.string();
}

std::string folder_of(const std::string& file) {
  const fs::path folder = fs::path(file).parent_path();
  return folder.empty() ? "." : folder.string();
}

/// The folder of the name, and what the name leads to when it is a link or a device.
void add_output(const std::string& word, CommandRights& rights) {
  rights.write.push_back(folder_of(word));
  std::error_code error;
  const fs::path target = fs::canonical(word, error);
  if (error || fs::is_directory(target, error)) return;
  rights.write.push_back(fs::is_regular_file(target, error) ? target.parent_path().string() : target.string());
}

bool names_pictures(const std::string& file) {
  return std::ranges::any_of(std::array{".pto", ".pts", ".ptv", ".json", ".csv"},
                             [&](const char* end) { return has_ending(file, end); });
}

void add_input(std::string word, CommandRights& rights) {
  if (word.starts_with(kRays)) word.erase(0, kRays.size());
  if (!is_there(word)) return;
  rights.read.push_back(word);
  if (names_pictures(word)) rights.read.push_back(folder_of(word));
  const std::string companion = fs::path(word).replace_extension(".rig.json").string();
  if (is_there(companion)) rights.read.push_back(companion);  // the calibration of a stitched sphere, see `convert`
  if (const std::string mask = mask_file_of(word); is_there(mask)) rights.read.push_back(mask);
  if (is_there(word + ".sig")) rights.read.push_back(word + ".sig");  // a calibration's signature
}

void add_option(const CLI::Option& option, CommandRights& rights) {
  const std::string name = option.get_lnames().empty() ? "" : option.get_lnames().front();
  const PathUse use = option.get_positional() ? PathUse::kInput : path_use(name);
  if (use == PathUse::kOutputFile && option.empty()) rights.write.push_back(".");  // the name that a command chooses
  for (const std::string& word : option.results()) {
    switch (use) {
      case PathUse::kInput: add_input(word, rights); break;
      case PathUse::kOutputFile: add_output(word, rights); break;
      case PathUse::kOutputFolder: rights.write.push_back(existing(word)); break;
      case PathUse::kNone: break;
    }
  }
}

void add_cpfind(CommandRights& rights) {
  rights.execute = {find_program("cpfind"), "/usr", "/lib", "/lib64"};
  rights.write.push_back(fs::temp_directory_path().string());
  rights.read.push_back("/etc");
}

/// The two programs that read and write films, and what loads them: nothing else is started.
void add_film_programs(CommandRights& rights) {
  for (const char* const name : {"ffmpeg", "ffprobe"}) {
    const std::string program = find_program(name);
    if (program.empty()) continue;
    for (const std::string& file : {program, loader_of(program)}) {
      if (!file.empty()) rights.execute.push_back(file);
    }
  }
}

std::string described(const CommandRights& rights, const hal::linux_os::Confined& done) {
  const std::string programs = rights.execute.empty() ? "none" : fmt::format("{}", fmt::join(rights.execute, " "));
  return fmt::format("nodal: confined by Landlock {}, seccomp {}; reads {}; writes {}; starts {}{}{}",
                     done.landlock == 0 ? "(none)" : fmt::format("version {}", done.landlock),
                     done.seccomp ? "yes" : "no", fmt::join(rights.read, " "), fmt::join(rights.write, " "), programs,
                     done.missing.empty() ? "" : "; ", done.missing);
}

bool is_off() {
  const char* const wanted = std::getenv("NODAL_CONFINE");
  return wanted != nullptr && std::string_view(wanted) == "off";
}

/// From now on the context's links are opened by a process that keeps its rights.
Status give_helper(Context& context) {
  const Result<RigAddress> address = context.address();
  if (!address) return {};  // connecting reports it
  auto helper = hal::LinkHelper::start([address = *address] { return open_link(address); });
  if (!helper) return fail(helper.error());
  context.open_link = [helper = std::shared_ptr<hal::LinkHelper>(std::move(*helper))](const RigAddress&) {
    return helper->connect();
  };
  return {};
}

}  // namespace

PathUse path_use(const std::string& option) {
  const auto* const found = std::ranges::find(kUses, option, &Use::option);
  return found == kUses.end() ? PathUse::kNone : found->use;
}

namespace {

/// Whether `convert` may write six faces of a cube, which have names of their own. Its option stands for faces by the
/// name of the layout that they are cut from; `convert` checks the names of both before it reads a picture.
bool may_be_faces(const CLI::App& convert) {
  const CLI::Option* const layout = convert.get_option_no_throw("--layout");
  return layout != nullptr && !layout->empty() && layout->results().front() == kFacesLayout;
}

/// That the folder of a file is there, and no file in its place: before hours of work, not after.
/// `prefix`: the command may write other names that begin like this one, and checks those itself.
Status check_writable(const std::string& file, bool prefix) {
  const fs::path folder = folder_of(file);
  std::error_code error;
  if (file != "-" && !fs::is_directory(folder, error)) {
    return fail(Errc::kNotFound, fmt::format("{}: there is no such folder as {}; make it (mkdir -p {})", file,
                                             folder.string(), folder.string()));
  }
  return prefix ? Status{} : check_free(file);
}

}  // namespace

Status check_outputs(const CLI::App& command) {
  for (const CLI::App* app = &command; app != nullptr; app = app->get_parent()) {
    for (const CLI::Option* option : app->get_options()) {
      const bool named = !option->get_lnames().empty() && !option->empty();
      if (!named || path_use(option->get_lnames().front()) != PathUse::kOutputFile) continue;
      for (const std::string& word : option->results()) {
        const std::string name = option->get_lnames().front();
        const bool prefix = app->get_name() == "convert" && name == "out" && may_be_faces(*app);
        if (const Status free = check_writable(word, prefix); !free) return fail(free.error().in("--" + name));
      }
    }
  }
  return {};
}

CommandRights rights_of(const CLI::App& command) {
  CommandRights rights;
  bool anywhere = false;
  for (const CLI::App* app = &command; app != nullptr; app = app->get_parent()) {
    for (const CLI::Option* option : app->get_options()) {
      // A page that shows a sphere writes nothing.
      const bool shows = command.get_name() == kLookCommand && option->check_lname("out") &&
                         command.get_option("INPUT")->results().size() < 2 && command.count(kHeadsFlag) == 0;
      if (shows) continue;
      add_option(*option, rights);
      if (option->empty()) continue;
      anywhere = anywhere || option->check_lname(std::string(kPicturesAnywhere).substr(2));
      if (option->check_lname(std::string(kCpfindFlag))) add_cpfind(rights);
    }
  }
  const CLI::Option* const out = command.get_option_no_throw("--out");
  const bool stitches = command.get_name() == kStitchCommand && out != nullptr && !out->empty();
  const bool renders = command.get_name() == kRenderCommand && is_coded_film(command);
  if (renders || (stitches && makes_film(out->results().front()))) add_film_programs(rights);
  if (anywhere) rights.read.push_back("/");
  for (std::vector<std::string>* paths : {&rights.read, &rights.write}) {
    std::ranges::sort(*paths);
    paths->erase(std::ranges::unique(*paths).begin(), paths->end());
  }
  return rights;
}

Status confine_command(Context& context, const CLI::App& command) {
  if (command.get_name() == kLookCommand || command.get_name() == kWebCommand) {
    NODAL_TRY(prepare_look(context, command));
  }
  if (command.get_name() == kRigsCommand) {
    NODAL_TRY(prepare_rigs(context));
  }
  if (is_off()) return {};
  NODAL_TRY(give_helper(context));
  const CommandRights rights = rights_of(command);
  hal::linux_os::Confinement wanted;
  wanted.read = rights.read;
  wanted.read.insert(wanted.read.end(), kEverywhere.begin(), kEverywhere.end());
  wanted.write = rights.write;
  wanted.write.emplace_back("/dev/null");
  wanted.execute = rights.execute;
  wanted.unix_sockets = false;
  const auto done = hal::linux_os::confine(wanted);
  if (!done) return fail(done.error().in("NODAL_CONFINE=off runs it unconfined"));
  if (context.verbose) context.console().note(described(rights, *done));
  return {};
}

}  // namespace nodal::host
