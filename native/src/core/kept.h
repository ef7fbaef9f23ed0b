// What outlasts a render: tables by name, as rows of numbers. Files and frames of them are Python's.
#pragma once
#include <map>
#include <string>
#include <vector>

namespace gi {

// What an integrator keeps from one render for the next: tables by name, as rows of numbers.
struct KeptTable {
  size_t columns = 0;
  std::vector<float> numbers;
  size_t rows() const { return columns ? numbers.size() / columns : 0; }
};
using Kept = std::map<std::string, KeptTable>;

}  // namespace gi
