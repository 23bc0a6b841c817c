#include "host_tool/commands/replay_toml.h"

#include <fmt/format.h>

#include <cctype>
#include <filesystem>

#include "firmware/config/written_toml.h"
#include "host_tool/console/files.h"
#include "host_tool/console/overwriting.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "stitch/media/image_file.h"
#include "stitch/media/png_writer.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestSource = 200;  // bytes of a file's name, in a comment

std::string toml_string(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code < 0x20 || code == 0x7F) {  // TOML allows control characters only as escapes
      quoted += fmt::format("\\u{:04X}", code);
      continue;
    }
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  quoted += '"';
  return quoted;
}

/// A rig's name as rig.toml takes it: 1 to 64 characters of A-Z a-z 0-9 . _ -
std::string rig_name(const std::string& calibration) {
  std::string name;
  for (const char c : calibration.substr(0, 64)) {
    const bool plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '_' || c == '-';
    name += plain ? c : '-';
  }
  return name.empty() ? "rig" : name;
}

}  // namespace

Result<std::vector<std::string>> replayed_files(const RigPictures& rig, const std::string& toml) {
  std::vector<std::string> files = rig.files().front();
  if (files.front().empty()) {
    return fail(Errc::kUnsupported,
                "--rig-toml: heads replay picture files, and these pictures are of a take or of "
                "films; for a take, write port = \"take:FOLDER/HEAD\" in a rig.toml of your own");
  }
  if (files.size() < 2 || files[0] != files[1]) return files;
  const fs::path path(toml);
  for (std::size_t h = 0; h < files.size(); ++h) {
    files[h] = (path.parent_path() / (path.stem().string() + "." + rig.heads[h] + ".png")).string();
    if (const Status free = check_free(files[h]); !free) return fail(free.error().in("--rig-toml"));
  }
  return files;
}

Status write_parts(const RigPictures& rig, const std::vector<std::string>& replayed) {
  for (std::size_t h = 0; h < replayed.size(); ++h) {
    const HeadPicture& picture = rig.sets.front()[h];
    if (picture.file() == replayed[h]) continue;
    const bool grey = picture.pixels().format == PixelFormat::kGrey8;
    const DecodedImage part =
        media::convert_image(picture.pixels().view(), grey ? PixelFormat::kGrey8 : PixelFormat::kRgb24);
    NODAL_TRY_ASSIGN(const auto png, media::png_file({part.width, part.height, grey ? 1 : 3, 8, part.bytes}, {}));
    NODAL_TRY(write_file(replayed[h], png));
  }
  return {};
}

Result<std::string> replay_rig_toml(const Calibration& calibration, const std::vector<std::string>& pictures,
                                    const std::string& source, const std::string& file) {
  std::string text = fmt::format(
      "# Heads that replay the pictures of {}. `nodald --explain KEY` explains a key.\n"
      "[rig]\nname = {}\nrate = \"30000/1001\"\n\n"
      "[raymap]\nlayout = \"equirectangular\"\nwidth = 2048\nheight = 1024\nformat = \"I420\"\n\n"
      "[links]\nunix = \"nodal.sock\"\n\n[store]\nfolder = \"store\"\n\n[takes]\nfolder = \"recorded\"\n",
      printable(source, kLongestSource), toml_string(rig_name(calibration.name)));
  const fs::path to = fs::absolute(file).parent_path();
  std::vector<firmware::WrittenHead> heads;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const fs::path picture = fs::absolute(pictures[i]).lexically_normal();
    const fs::path relative = picture.lexically_relative(to);
    const bool nearby = !relative.empty() && *relative.begin() != "..";
    heads.push_back({calibration.heads[i].name, "replay:" + (nearby ? relative : picture).string()});
    text += fmt::format("\n[[heads]]\nname = {}\nport = {}\n", toml_string(heads.back().name),
                        toml_string(heads.back().port));
  }
  if (const Status good = firmware::check_written_toml(text, file, heads); !good) {
    std::string names;
    for (const firmware::WrittenHead& head : heads) names += (names.empty() ? "'" : ", '") + head.name + "'";
    return fail(good.error().code,
                fmt::format("no rig.toml is written, because nodald could not read it: {} (its heads "
                            "would be {})",
                            good.error().message, names));
  }
  return text;
}

}  // namespace nodal::host
