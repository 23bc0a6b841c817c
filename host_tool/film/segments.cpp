#include "host_tool/film/segments.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "host_tool/console/files.h"
#include "host_tool/film/attempts.h"
#include "host_tool/film/film_encoder.h"
#include "protocol/base/sha256.h"
#include "protocol/base/try.h"
#include "protocol/files/open_file.h"

namespace nodal::film {
namespace {

namespace fs = std::filesystem;

struct Content {
  std::uint64_t bytes = 0;
  std::string sha256;
};

/// Reads a file, and has it on disk.
Result<Content> content_of(const std::string& path, bool sync) {
  const Result<int> opened = open_descriptor_to_read(path);
  if (!opened) return fail(opened.error().in(path));
  const int file = *opened;
  Sha256Stream hash;
  Content content;
  std::vector<std::uint8_t> piece(1 << 20);
  ssize_t count = 0;
  while ((count = ::read(file, piece.data(), piece.size())) > 0) {
    hash.update(std::span(piece).first(static_cast<std::size_t>(count)));
    content.bytes += static_cast<std::uint64_t>(count);
  }
  const bool good = count == 0 && (!sync || ::fsync(file) == 0);
  const int error = errno;
  ::close(file);
  if (!good) return fail(Errc::kIo, fmt::format("{}: {}", path, std::strerror(error)));
  content.sha256 = to_hex(hash.finish());
  return content;
}

/// Removes the attempt's file unless it was renamed.
struct Attempt {
  std::string file;
  ~Attempt() {
    if (!file.empty()) ::unlink(file.c_str());
  }
};

auto stopped() { return fail(Errc::kCancelled, "stopped"); }

}  // namespace

PartsFolder parts_of(const std::string& out) { return {out + ".parts"}; }

std::string PartsFolder::segment_file(const FilmPlan& plan, std::uint64_t segment) const {
  return fmt::format("{}/seg-{:05}.{}{}", path, segment, plan.id, segment_ending(plan.coding.codec));
}

bool PartsFolder::has(const FilmPlan& plan, std::uint64_t segment) const {
  const std::string file = segment_file(plan, segment);
  const auto text = host::read_file(file + ".json", 4096);
  if (!text) return false;
  const Json record = Json::parse(*text, nullptr, false);
  if (!record.is_object() || !record.contains("bytes") || !record.contains("sha256")) return false;
  const auto content = content_of(file, false);
  return content && record["bytes"] == content->bytes && record["sha256"] == content->sha256;
}

Result<std::optional<FilmPlan>> stored_plan(const PartsFolder& parts, const Json& request) {
  const auto text = host::read_file(parts.plan_file(), kMaxPlanBytes);
  if (!text && text.error().code == Errc::kNotFound) return std::nullopt;
  if (!text) return fail(text.error());
  auto plan = plan_of(*text);
  if (!plan) return fail(plan.error().in(parts.plan_file()));
  if (plan->request == request) return std::optional(std::move(*plan));
  std::string differs;
  for (const auto& [key, value] : request.items()) {
    if (plan->request.contains(key) && plan->request[key] == value) continue;
    differs += (differs.empty() ? "" : ", ") + key;
  }
  return fail(
      Errc::kWrongState,
      fmt::format("{}: it is the plan of another film or of other settings ({}); remove the folder {}, or choose "
                  "another --out",
                  parts.plan_file(), differs, parts.path));
}

Result<FilmPlan> store_plan(const PartsFolder& parts, const FilmPlan& plan) {
  std::error_code error;
  fs::create_directories(parts.path, error);
  if (error) return fail(Errc::kIo, fmt::format("{}: it cannot be made: {}", parts.path, error.message()));
  remove_dead_attempts(parts.path + "/");
  const std::string text = to_text(plan);
  const std::string file = attempt_name(parts.plan_file());
  const Attempt attempt{file};
  NODAL_TRY(host::write_file(file, text));
  // A link, unlike a rename, leaves the plan that another process has written meanwhile.
  if (::link(file.c_str(), parts.plan_file().c_str()) != 0 && errno != EEXIST) {
    return fail(Errc::kIo, fmt::format("{}: {}", parts.plan_file(), std::strerror(errno)));
  }
  NODAL_TRY_ASSIGN(auto stored, stored_plan(parts, plan.request));
  if (!stored) return fail(Errc::kIo, fmt::format("{}: it disappeared", parts.plan_file()));
  return std::move(*stored);
}

Status plan_seams(FilmPlan& plan, FrameSource& source, const FilmProgress& progress) {
  if (plan.raymap.seams != SeamPlacement::kPlaced) return {};
  for (std::uint64_t segment = 0; segment < plan.segments(); ++segment) {
    if (!progress(segment)) return stopped();
    NODAL_TRY_ASSIGN(auto labels, source.place_seams(segment));
    const PlannedSeams* const before = plan.seams_at(segment);
    if (labels.empty() || (before != nullptr && before->labels == labels)) continue;
    plan.seams.push_back({segment, std::move(labels)});
  }
  return {};
}

Result<RenderedSegment> render_segment(const FilmPlan& plan, std::uint64_t segment, const PartsFolder& parts,
                                       FrameSource& source, const Programs& programs, const FilmProgress& progress) {
  const std::uint64_t begin = plan.begin_of(segment), end = plan.end_of(segment);
  const std::string file = parts.segment_file(plan, segment);
  RenderedSegment rendered;
  remove_dead_attempts(file);
  NODAL_TRY(source.begin(segment));
  Attempt attempt{attempt_name(file)};
  NODAL_TRY_ASSIGN(const auto encoder, FilmEncoder::open(programs, plan.coding, attempt.file));
  for (std::uint64_t frame = begin; frame < end; ++frame) {
    if (!progress(frame - begin)) return stopped();
    std::vector<std::uint8_t> raymap = encoder->memory();
    NODAL_TRY(source.next(raymap));
    NODAL_TRY(encoder->write(std::move(raymap)));
  }
  NODAL_TRY(encoder->finish());
  rendered.notes = source.finish();
  NODAL_TRY_ASSIGN(const Content content, content_of(attempt.file, true));
  if (::rename(attempt.file.c_str(), file.c_str()) != 0) {
    return fail(Errc::kIo, fmt::format("{}: {}", file, std::strerror(errno)));
  }
  attempt.file.clear();
  const Json record{{"frames", end - begin}, {"bytes", content.bytes}, {"sha256", content.sha256}};
  const std::string record_file = file + ".json";
  ::unlink(record_file.c_str());  // the record of a segment that was not whole any more
  const Status written = host::write_file(record_file, record.dump() + "\n");
  // Another process that makes the same segment may have written its record meanwhile; the bytes are the same.
  if (!written && !(written.error().code == Errc::kExists && parts.has(plan, segment))) return fail(written.error());
  return rendered;
}

}  // namespace nodal::film
