#include "tests/support/foreign_takes.h"

#include <fstream>
#include <string>
#include <vector>

#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::test {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;

constexpr std::uint64_t kGiB = std::uint64_t{1} << 30;

void append(Bytes& to, const Bytes& bytes) { to.insert(to.end(), bytes.begin(), bytes.end()); }

take::wire::Record begin_record(std::uint32_t heads, bool raymaps) {
  take::wire::Record record;
  take::wire::Begin& begin = *record.mutable_begin();
  begin.set_version(1);
  begin.set_take(1);
  for (std::uint32_t k = 0; k < heads + (raymaps ? 1 : 0); ++k) {
    take::wire::File& file = *begin.add_files();
    file.set_name(k < heads ? take::head_file(k, 0) : take::raymap_file(0));
    if (k < heads) file.set_head(k);
    file.set_format("MJPEG");
    file.set_width(64);
    file.set_height(64);
  }
  return record;
}

Bytes evidence_of_a_huge_row() {
  constexpr std::uint64_t kPieces = 3990;
  take::EvidenceWriter writer;
  Bytes bytes = writer.encode(begin_record(1, false));
  take::wire::Record set;
  set.mutable_set()->add_frames()->set_bytes(kPieces << 20);
  append(bytes, writer.encode(set));
  take::wire::Record clusters;
  clusters.mutable_clusters()->set_sets(1);
  clusters.mutable_clusters()->add_end(kPieces << 20);
  clusters.mutable_clusters()->add_hashes(std::string(kPieces * 16, 'h'));
  append(bytes, writer.encode(clusters));
  return bytes;
}

Bytes evidence_of_raymaps() {
  take::EvidenceWriter writer;
  Bytes bytes = writer.encode(begin_record(1, true));
  take::wire::Record clusters;
  for (int k = 0; k < 2; ++k) {
    clusters.mutable_clusters()->add_end(0);
    clusters.mutable_clusters()->add_hashes();
  }
  for (int k = 0; k < 30'000; ++k) clusters.mutable_clusters()->add_raymaps();
  while (bytes.size() + (64 << 10) < take::kMaxEvidenceBytes) append(bytes, writer.encode(clusters));
  return bytes;
}

Bytes evidence_of_most_sets() {
  constexpr std::uint32_t kHeads = 16;
  take::EvidenceWriter writer;
  Bytes bytes = writer.encode(begin_record(kHeads, false));
  for (std::uint64_t k = 0; k < take::kMaxSegmentSets; ++k) {
    take::wire::Record set, clusters;
    set.mutable_set()->set_index(k);
    set.mutable_set()->set_genlock("locked");
    clusters.mutable_clusters()->set_sets(k + 1);
    for (std::uint32_t head = 0; head < kHeads; ++head) {
      take::wire::Frame& frame = *set.mutable_set()->add_frames();
      frame.set_file(head);
      frame.set_placeholder("missing");
      clusters.mutable_clusters()->add_end(0);
      clusters.mutable_clusters()->add_hashes();
    }
    append(bytes, writer.encode(set));
    append(bytes, writer.encode(clusters));
  }
  return bytes;
}

void put_bytes(const fs::path& file, const Bytes& bytes) {
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

/// Its folder, with take.json.
fs::path begin_take(const fs::path& takes, std::uint64_t number) {
  fs::path folder = takes / take::take_folder(number);
  fs::create_directories(folder);
  take::TakeDocument about;
  about.number = number;
  about.rig = "another";
  about.software = "another";
  about.rate = {30, 1};
  about.mode = "driver";
  about.heads = {"cam0"};
  std::ofstream(folder / take::kTakeFile) << take::take_json(about);
  return folder;
}

}  // namespace

void put_foreign_takes(const fs::path& takes) {
  const fs::path first = begin_take(takes, 1), second = begin_take(takes, 2), third = begin_take(takes, 3),
                 fourth = begin_take(takes, 4);
  put_bytes(first / "evidence-0000", evidence_of_a_huge_row());
  std::ofstream(first / take::head_file(0, 0)) << "";
  fs::resize_file(first / take::head_file(0, 0), 4 * kGiB);  // sparse
  {
    std::ofstream manifest(second / take::kManifestFile);
    for (int k = 0; k < (31 << 20) / 2; ++k) manifest << "{}";
  }
  put_bytes(third / "evidence-0000", evidence_of_raymaps());
  put_bytes(fourth / "evidence-0000", evidence_of_most_sets());
  for (std::uint32_t head = 0; head < 16; ++head) std::ofstream(fourth / take::head_file(head, 0)) << "";
}

}  // namespace nodal::test
