// Nothing: the headers that position-independent rooms share are precompiled with the target that
// this file belongs to.
