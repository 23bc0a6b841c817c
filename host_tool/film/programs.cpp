#include "host_tool/film/programs.h"

#include "host_tool/film/film_list.h"

#include <fmt/format.h>

#include <charconv>

#include "host_tool/child/child.h"
#include "host_tool/child/find_program.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"

namespace nodal::film {
namespace {

constexpr std::size_t kMaxAnswer = 1 << 20;  // `ffmpeg -encoders` has 16 kB
constexpr int kOldestMajor = 5, kOldestMinor = 1;

Result<std::string> answer(const std::string& program, std::vector<std::string> words) {
  NODAL_TRY_ASSIGN(const auto child, Child::start({.program = program, .arguments = std::move(words), .output = true}));
  NODAL_TRY_ASSIGN(std::string text, child->read_all(kMaxAnswer));
  const Child::End end = child->wait();
  if (!end.good()) {
    return fail(Errc::kDeviceFailed,
                fmt::format("{} {}; reinstall it: apt install ffmpeg", program, end_of(end, child->complaint())));
  }
  return text;
}

}  // namespace

Result<std::string> version_of(std::string_view text) {
  constexpr std::string_view kBefore = "ffmpeg version ";
  if (!text.starts_with(kBefore)) return fail(Errc::kBadFormat, "it does not say its version");
  text.remove_prefix(kBefore.size());
  const std::string version = printable(text.substr(0, text.find_first_of(" \n")), 60);
  int major = 0, minor = 0;
  const char* const end = version.data() + version.size();
  const auto [dot, error] = std::from_chars(version.data(), end, major);
  if (error != std::errc()) return version;
  if (dot != end && *dot == '.') std::from_chars(dot + 1, end, minor);
  if (major > kOldestMajor || (major == kOldestMajor && minor >= kOldestMinor)) return version;
  return fail(Errc::kVersionMismatch, fmt::format("version {} is older than {}.{}; install a newer ffmpeg", version,
                                                  kOldestMajor, kOldestMinor));
}

Result<Programs> find_programs() {
  Programs programs{find_program("ffmpeg"), find_program("ffprobe"), "", {}};
  for (const auto& [path, name] : {std::pair{&programs.ffmpeg, "ffmpeg"}, std::pair{&programs.ffprobe, "ffprobe"}}) {
    if (path->empty()) {
      return fail(Errc::kNotFound, fmt::format("films are read and written by the program {}, which is not installed: "
                                               "apt install ffmpeg",
                                               name));
    }
  }
  NODAL_TRY_ASSIGN(const std::string version, answer(programs.ffmpeg, {"-version"}));
  const auto known = version_of(version);
  if (!known) return fail(known.error().in(programs.ffmpeg));
  programs.version = *known;
  NODAL_TRY_ASSIGN(const std::string list, answer(programs.ffmpeg, {"-hide_banner", "-encoders"}));
  // " V....D libx264              libx264 H.264 / AVC ..." after a line of dashes
  std::size_t from = list.find("------");
  while (from < list.size()) {
    from = list.find('\n', from);
    if (from == std::string::npos) break;
    const std::string_view line = std::string_view(list).substr(from + 1, list.find('\n', from + 1) - from - 1);
    ++from;
    constexpr std::size_t kName = 8;
    if (line.size() > kName) programs.encoders.emplace(line.substr(kName, line.find(' ', kName) - kName));
  }
  return programs;
}

std::string file_url(const std::string& path) { return "file:" + path; }

std::vector<std::string> input_rules(const std::string& path) {
  const std::string films =
      "mov,mp4,matroska,webm,avi,mpegts,mpeg,mpegvideo,mxf,nut,ogg,flv,asf,dv,gxf,h264,hevc,ivf,m4v,obu,wav,flac,"
      "mp3,aac";
  std::vector<std::string> rules{"-protocol_whitelist", "file,pipe", "-format_whitelist"};
  if (!is_list(path)) {
    rules.push_back(films);
    return rules;
  }
  rules.insert(rules.end(), {films + ",concat,png_pipe,jpeg_pipe,tiff_pipe", "-f", "concat", "-safe", "0"});
  return rules;
}

}  // namespace nodal::film
