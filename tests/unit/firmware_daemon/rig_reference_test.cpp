// RIG.md names every key that the parser of rig.toml knows, and `nodald --explain` cuts it by key.
#include "firmware/daemon/rig_reference.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <set>

#include "firmware/config/config.h"
#include "protocol/base/fit_text.h"

namespace nodal::daemon {
namespace {

const std::string& reference() {
  static const std::string text = [] {
    std::ifstream in(NODAL_SOURCE_DIR "/firmware/RIG.md");
    return std::string(std::istreambuf_iterator<char>(in), {});
  }();
  return text;
}

/// The parser's own list of a section's keys, from its error about one that is like none of them.
std::vector<std::string> keys_of_the_parser(const std::string& section) {
  std::string rig = "[rig]\nname = \"small\"\n", heads = "[[heads]]\nname = \"cam0\"\nport = \"sim:cam0\"\n",
              sim = "[sim]\ncalibration = \"truth.json\"\n";
  const std::string wrong = "qqqqqqqqqqqqqqqqqqqq = 1\n";
  std::string others;
  if (section == "rig") rig += wrong;
  else if (section == "heads") heads += wrong;
  else if (section == "sim") sim += wrong;
  else others = "[" + section + "]\n" + (section == "takes" ? "folder = \"takes\"\n" : "") + wrong;
  const auto config = firmware::parse_rig_config(rig + sim + others + heads, "rig.toml");
  const std::string message = config ? "" : config.error().message;
  const std::string before = "the keys allowed here are ";
  const std::size_t at = message.find(before);
  EXPECT_NE(at, std::string::npos) << section << ": " << message;
  std::vector<std::string> keys;
  if (at == std::string::npos) return keys;
  std::string word;
  for (const char c : message.substr(at + before.size()) + ",") {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_') {
      word += c;
    } else if (!word.empty()) {
      keys.push_back(section + "." + word);
      word.clear();
    }
  }
  return keys;
}

TEST(RigReference, HasAHeadingForEveryKeyOfTheParser_AndForNoOther) {
  std::set<std::string> known;
  for (const char* section :
       {"rig", "raymap", "trigger", "exposure", "links", "panel", "takes", "store", "calibration", "heads", "sim"}) {
    for (const std::string& key : keys_of_the_parser(section)) known.insert(key);
  }
  known.erase("links.tcp_port");  // only an error that says what to use instead
  ASSERT_GE(known.size(), 70U);
  const std::vector<std::string> listed = explained_keys(reference());
  EXPECT_EQ(std::set<std::string>(listed.begin(), listed.end()), known);
  EXPECT_EQ(listed.size(), known.size()) << "each once";
}

TEST(RigReference, EveryKey_IsExplainedInLinesOfATerminalWithItsValuesAndDefault) {
  for (const std::string& key : explained_keys(reference())) {
    const auto text = explain(reference(), key);
    ASSERT_TRUE(text) << text.error().message;
    EXPECT_NE(text->find("Allowed:"), std::string::npos) << *text;
    EXPECT_TRUE(text->find("Default:") != std::string::npos || text->find("Required") != std::string::npos) << *text;
    EXPECT_EQ(text->find("]("), std::string::npos) << "links are for readers of RIG.md\n" << *text;
    for (std::size_t from = 0; from < text->size();) {
      const std::size_t to = text->find('\n', from);
      ASSERT_NE(to, std::string::npos) << "the last line ends, too";
      const std::string line = text->substr(from, to - from);
      EXPECT_LE(width_of(line), kLineWidth) << line;
      from = to + 1;
    }
  }
}

const std::string kText = R"(# Keys

## takes

What it is, and
[a link](#below).

### takes.mode

How pictures are
stored. More.

- `raw`: as they are, which is said in so many words that the line has to be broken;
- `jpeg`: coded.

    a = 1

### takes.left, takes.right

Two.

## Below

### GPIO lines

No key.
)";

TEST(Explain, AKey_HasItsParagraphsListsAndCode) {
  const auto text = explain(kText, "takes.mode");
  ASSERT_TRUE(text) << text.error().message;
  EXPECT_EQ(*text,
            "takes.mode\n\nHow pictures are stored. More.\n\n"
            "- `raw`: as they are, which is said in so many words that the line has to be\n  broken;\n"
            "- `jpeg`: coded.\n\n    a = 1\n");
}

TEST(Explain, ASection_HasItsTextAndTheFirstSentenceOfEachKey) {
  const auto text = explain(kText, "[takes]");
  ASSERT_TRUE(text) << text.error().message;
  EXPECT_EQ(*text,
            "[takes]\n\nWhat it is, and a link.\n\nKeys:\n  takes.mode               How pictures are stored\n"
            "  takes.left, takes.right  Two\n");
}

TEST(Explain, OneOfTwoNames_APartOfAName_AndAnElementOfAList_AreFound) {
  for (const char* key : {"takes.right", "right", "takes[3].right"}) {
    const auto text = explain(kText, key);
    ASSERT_TRUE(text) << key << text.error().message;
    EXPECT_EQ(*text, "takes.left, takes.right\n\nTwo.\n") << key;
  }
}

TEST(Explain, WhatIsNoKey_IsAnErrorThatNamesTheNearestOrTheSections) {
  const auto near = explain(kText, "takes.mod");
  ASSERT_FALSE(near);
  EXPECT_EQ(near.error().code, Errc::kNotFound);
  EXPECT_EQ(near.error().message, "rig.toml has no key 'takes.mod'; did you mean 'takes.mode'?");
  const auto far = explain(kText, "GPIO lines");
  ASSERT_FALSE(far);
  EXPECT_NE(far.error().message.find("or a section: takes"), std::string::npos) << far.error().message;
}

}  // namespace
}  // namespace nodal::daemon
