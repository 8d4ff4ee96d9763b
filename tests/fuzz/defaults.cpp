// Defaults of the fuzz targets as programs of libFuzzer, for millions of small inputs. Options of the command line and of the environment come later and prevail.
#include <string>
#include <vector>

/// Freed memory is kept from use for 8 MB, more than an input takes, and its reports show two calls: the defaults cost as much as most inputs.
extern "C" const char* __asan_default_options() { return "quarantine_size_mb=8:malloc_context_size=2"; }

extern "C" int LLVMFuzzerInitialize(int* count, char*** words) {
  // Long inputs repeat what short ones do. To choose inputs by how rare is what they reach takes longer than to read a scene. Other processes find no inputs for this one,
  // and names of new functions take seconds.
  static std::vector<std::string> defaults{"-max_len=" SUPPLE_FUZZ_LONGEST, "-entropic=0", "-reload=0", "-print_funcs=0", "-timeout=120", "-rss_limit_mb=4096", "-print_final_stats=1"};
  static std::vector<char*> all(*words, *words + *count);
  for (std::size_t k = 0; k < defaults.size(); ++k) all.insert(all.begin() + 1 + static_cast<std::ptrdiff_t>(k), defaults[k].data());
  *count = static_cast<int>(all.size());
  all.push_back(nullptr);
  *words = all.data();
  return 0;
}
