// What the MSL of a kernel needs to be CUDA C++: enough to compile it, not to run it.
typedef unsigned int uint;
#define constant const
#define device
#define thread
#define threadgroup
#define kernel __forceinline__
template <class T, class U> T as_type(U from) {
    T to;
    memcpy(&to, &from, sizeof to);
    return to;
}
namespace metal {
using ::uint;
struct uint2 {
    uint x, y;
    uint2() = default;
    constexpr uint2(uint x, uint y) : x(x), y(y) {}
    explicit uint2(uint all) : x(all), y(all) {}
};
struct float2 {
    float x, y;
    float2() = default;
    float2(float x, float y) : x(x), y(y) {}
};
struct float4 {
    float x, y, z, w;
};
struct bool2 {
    bool x, y;
};
struct uint3 {
    uint x, y, z;
    uint3() = default;
    constexpr uint3(uint x, uint y, uint z) : x(x), y(y), z(z) {}
};
struct uint4 {
    uint x, y, z, w;
    uint4() = default;
    uint4(uint x, uint y, uint z, uint w) : x(x), y(y), z(z), w(w) {}
};
inline uint2 operator+(uint2 a, uint2 b) { return uint2(a.x + b.x, a.y + b.y); }
inline uint2 operator-(uint2 a, uint2 b) { return uint2(a.x - b.x, a.y - b.y); }
inline uint2 operator*(uint2 a, uint2 b) { return uint2(a.x * b.x, a.y * b.y); }
inline uint2 &operator-=(uint2 &a, uint2 b) { return a = a - b; }
inline bool2 operator==(uint2 a, uint2 b) { return {a.x == b.x, a.y == b.y}; }
inline bool all(bool2 both) { return both.x && both.y; }
inline float abs(float x) { return fabsf(x); }
inline int abs(int x) { return x < 0 ? -x : x; }
template <class T> T select(T no, T yes, bool which) { return which ? yes : no; }
inline float clamp(float x, float low, float high) { return fminf(fmaxf(x, low), high); }
inline int clamp(int x, int low, int high) { return min(max(x, low), high); }
inline uint clamp(uint x, uint low, uint high) { return min(max(x, low), high); }
inline uint min(uint a, uint b) { return ::min(a, b); }
inline uint clz(uint x) { return __clz(x); }
inline uint popcount(uint x) { return __popc(x); }
typedef uint atomic_uint;
enum memory_order { memory_order_relaxed };
enum class mem_flags { mem_threadgroup };
inline void threadgroup_barrier(mem_flags) { __syncthreads(); }
inline void atomic_store_explicit(uint *at, uint value, memory_order) { *(volatile uint *)at = value; }
inline uint atomic_load_explicit(uint *at, memory_order) { return *(volatile uint *)at; }
inline uint atomic_fetch_add_explicit(uint *at, uint by, memory_order) { return atomicAdd(at, by); }
inline uint atomic_fetch_or_explicit(uint *at, uint by, memory_order) { return atomicOr(at, by); }
inline uint atomic_fetch_min_explicit(uint *at, uint by, memory_order) { return atomicMin(at, by); }
}
