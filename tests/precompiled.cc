// Nothing: the headers that tests share are precompiled with the target that this file belongs to.
