// `nodal take verify`: a copy of a take against its manifest.
#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <memory>
#include <span>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/quantities.h"
#include "host_tool/offload/local_file.h"
#include "host_tool/offload/take_files.h"
#include "protocol/base/sha256.h"
#include "protocol/base/try.h"
#include "protocol/take/digest.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;
using take::PieceHashes;
using Bytes = std::vector<std::uint8_t>;

/// The hashes of the video files' pieces, from the evidence beside them.
std::map<std::string, std::vector<take::Xxh128>> hashes_in(const fs::path& folder, const take::Manifest& manifest) {
  std::map<std::string, std::vector<take::Xxh128>> all;
  const auto files = take_files(folder);
  for (const take::Manifest::File& file : manifest.files) {
    const auto named = take::segment_file(file.name);
    if (!named || named->kind != take::SegmentFile::Kind::kEvidence) continue;
    const auto bytes = media::read_take_file(*files, file.name, take::kMaxEvidenceBytes);
    if (!bytes) continue;
    PieceHashes hashes;
    hashes.update(*bytes);
    if (take::digest_of(hashes.all()) != file.digest) continue;
    const auto segment = take::read_evidence(*bytes, file.name);
    for (int k = 0; segment && k < segment->begin.files_size(); ++k) {
      all[segment->begin.files(k).name()] = segment->hashes_of(static_cast<std::size_t>(k));
    }
  }
  return all;
}

/// Checks files one after the other, and says what is wrong with each.
class Verifier {
 public:
  Verifier(Console& console, const fs::path& folder, const take::Manifest& manifest)
      : folder_(folder), pieces_(hashes_in(folder, manifest)), progress_(console, "verifying", manifest.bytes()) {}

  /// A sentence for a file that differs; empty: it is whole.
  std::string check(const take::Manifest::File& file) {
    const auto open = LocalFile::open_to_read(folder_ / file.name);
    const auto size = open ? open->size() : Result<std::uint64_t>(fail(open.error()));
    if (!size) return size.error().message;
    PieceHashes hashes;
    Bytes bytes(PieceHashes::kPiece);
    while (hashes.bytes() < *size && !interrupted()) {
      const auto read = open->read(hashes.bytes(), bytes);
      if (!read) return fmt::format("{}, at byte {}", read.error().message, hashes.bytes());
      if (*read == 0) break;
      hashes.update(std::span(bytes).first(*read));
      progress_.update(done_ += *read, file.name);
    }
    if (hashes.bytes() != file.bytes)
      return fmt::format("{}: has {} bytes, not {}", file.name, hashes.bytes(), file.bytes);
    const std::vector<take::Xxh128> found = hashes.all();
    if (take::digest_of(found) == file.digest) return {};
    const auto expected = pieces_.find(file.name);
    if (expected == pieces_.end() || expected->second.size() != found.size())
      return file.name + ": its content differs";
    std::size_t differ = 0, first = found.size();
    for (std::size_t k = found.size(); k-- > 0;) {
      if (found[k] == expected->second[k]) continue;
      ++differ;
      first = k;
    }
    return fmt::format("{}: {} of {} MiB differ, the first at byte {}", file.name, differ, found.size(),
                       first * PieceHashes::kPiece);
  }

 private:
  const fs::path folder_;
  const std::map<std::string, std::vector<take::Xxh128>> pieces_;
  Progress progress_;
  std::uint64_t done_ = 0;
};

Status run_verify(Context& context, const std::string& name) {
  watch_interrupts();
  const fs::path folder = name;
  std::error_code error;
  if (!fs::is_directory(folder, error)) return fail(Errc::kNotFound, name + ": there is no such folder");
  NODAL_TRY_ASSIGN(const auto text, media::read_manifest_file(*take_files(folder)));
  NODAL_TRY_ASSIGN(const auto manifest, take::parse_manifest({reinterpret_cast<const char*>(text.data()), text.size()},
                                                             (folder / take::kManifestFile).string()));
  const std::string id = nodal::to_hex(sha256(text));
  std::vector<std::string> wrong;
  {
    Verifier verifier(context.console(), folder, manifest);
    for (const take::Manifest::File& file : manifest.files) {
      if (std::string problem = verifier.check(file); !problem.empty()) wrong.push_back(std::move(problem));
      if (interrupted()) {
        return fail(Errc::kCancelled, "interrupted; what was checked so far says nothing about the rest");
      }
    }
  }
  context.console().document({{"take", manifest.number},
                              {"id", id},
                              {"files", manifest.files.size()},
                              {"bytes", manifest.bytes()},
                              {"sets", manifest.sets},
                              {"whole", wrong.empty()},
                              {"problems", wrong}});
  for (const std::string& problem : wrong) context.console().line(context.console().paint(Colour::kBad, problem));
  if (!wrong.empty()) context.answer = ExitCode::kJudged;
  context.console().line(
      fmt::format("take {}: {}, {}, {}: {}; id {}", manifest.number, counted(manifest.files.size(), "file"),
                  show_bytes(manifest.bytes()), counted(manifest.sets, "set"),
                  wrong.empty() ? "whole" : fmt::format("{} damaged; copy them again", wrong.size()), id));
  return {};
}

}  // namespace

void add_take_verify(CLI::App& group, CommandLine& line) {
  auto folder = std::make_shared<std::string>();
  CLI::App* verify = add_command(group, "verify", "Compare a copy of a take with its manifest, byte by byte",
                                 "  scp -r rig.local:/var/lib/nodal/takes/000042 .\n"
                                 "  nodal take verify 000042\n"
                                 "Exits with 8 if a file differs.\n");
  verify->add_option("FOLDER", *folder, "The folder of the take")->required()->type_name("");
  line.on(verify, [folder](Context& context) { return run_verify(context, *folder); });
}

}  // namespace nodal::host
