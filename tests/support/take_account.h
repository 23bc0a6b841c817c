// What the evidence of a take on a disk accounts for.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hal/disk.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::firmware {

/// What the evidence of a take says, read whole: an index for every set, and a gap for every set that is not there.
struct TakeAccount {
  std::uint64_t sets = 0;
  std::uint64_t missed = 0;  ///< between the first and the last, said by the sets
  std::uint64_t end = 0;     ///< index behind the last set
  std::uint64_t cut = 0;     ///< between segments, after a failed sync
  std::vector<std::pair<std::uint64_t, std::uint64_t>> segments{};  ///< first set, and behind the last
};
/// `most`: segments that are read.
inline TakeAccount account_of(hal::DiskPort& disk, std::uint64_t take, std::size_t most = ~std::size_t{0}) {
  TakeAccount account;
  const std::string folder = take::take_folder(take);
  std::optional<std::uint64_t> next;
  for (const std::string& name : disk.list(folder).value_or(std::vector<std::string>())) {
    if (!name.starts_with("evidence-") || account.segments.size() == most) continue;
    const auto bytes = disk.read(folder + "/" + name, take::kMaxEvidenceBytes);
    const auto segment = take::read_evidence(bytes.value_or(std::vector<std::uint8_t>()), name);
    EXPECT_TRUE(segment) << segment.error().text();
    if (!segment) continue;
    EXPECT_TRUE(segment->end.has_value()) << name;
    EXPECT_EQ(segment->good_bytes, bytes->size()) << name;
    EXPECT_GE(segment->begin.first_set(), account.end) << name;
    const std::uint64_t deleted = segment->begin.first_set() - account.end;
    for (const take::wire::Set& set : segment->sets) {
      const bool begins = set.index() == segment->begin.first_set();
      const std::uint64_t expected = next ? *next + set.missed() + (begins ? deleted : 0) : set.number();
      EXPECT_GE(set.number(), expected) << name;
      const bool may_be_cut = begins && deleted == 0;
      EXPECT_TRUE(may_be_cut || set.number() == expected) << name << " set " << set.index();
      account.cut += set.number() - expected;
      next = set.number() + 1;
      account.missed += set.missed();
    }
    account.sets += segment->sets.size();
    account.end = segment->next_set();
    account.segments.emplace_back(segment->begin.first_set(), segment->next_set());
  }
  return account;
}

}  // namespace nodal::firmware
